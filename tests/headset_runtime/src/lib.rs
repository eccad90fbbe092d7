//! An OpenVR runtime without a headset. OpenVR's own loader loads it like SteamVR's; a script (`script::Script`) says
//! what the headset is and what happens to it; it logs every call and writes what each eye was shown.
//!
//! Installed as `DIR/bin/linux64/vrclient.so` or `DIR\bin\vrclient_x64.dll`, DIR being named by the file that
//! VR_PATHREG_OVERRIDE names. It is as strict as it can be: what makes some runtime abort makes this one abort.

#![allow(clippy::unnecessary_cast, reason = "enumerations of C are signed with MSVC and unsigned elsewhere")]

mod chaperone;
mod client_core;
mod compositor;
mod copier;
mod frame_times;
mod images;
mod input;
mod log;
mod overlay;
mod pace;
mod place;
mod runtime;
pub mod script;
mod system;
mod tracking;
