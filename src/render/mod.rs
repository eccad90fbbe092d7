//! One frame for N eyes: sky, forward, resolve.
