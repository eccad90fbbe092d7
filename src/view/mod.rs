//! Where eyes come from and where pictures go: window, picture file; camera control.
