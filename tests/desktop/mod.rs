//! A desktop for tests: an X server of one's own, the program on it, and hands on its window.
#![allow(dead_code)]

use std::io::{BufRead, BufReader, IoSlice};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use x11rb::CURRENT_TIME;
use x11rb::connection::{Connection, RequestConnection as _};
use x11rb::protocol::Event;
use x11rb::protocol::xproto::{
    Atom, AtomEnum, BUTTON_PRESS_EVENT, BUTTON_RELEASE_EVENT, ClientMessageEvent, ConfigureWindowAux,
    ConnectionExt as _, CreateWindowAux, EventMask, InputFocus, KEY_PRESS_EVENT, KEY_RELEASE_EVENT,
    MOTION_NOTIFY_EVENT, MapState, PropMode, SELECTION_NOTIFY_EVENT, SelectionNotifyEvent, Window, WindowClass,
};
use x11rb::rust_connection::RustConnection;
use x11rb::wrapper::ConnectionExt as _;

use crate::common::{control_in, signal};

const PATIENCE: Duration = Duration::from_secs(180);
pub const SCREEN: [u16; 2] = [2600, 2000];

/// An X server of a test's own, on a free display number; it ends with the test.
pub struct Display {
    server: Child,
    name: String,
}

impl Display {
    /// Starts one; `None`, with the reason printed, where Xvfb is not installed. In CI that is a failure.
    pub fn start() -> Option<Self> {
        let screen = format!("{}x{}x24", SCREEN[0], SCREEN[1]);
        // Xvfb picks a free number itself and tells it on file descriptor 1. Without -noreset it starts anew whenever the last
        // program leaves it, and for a moment takes no other.
        let server = Command::new("Xvfb")
            .args(["-displayfd", "1", "-screen", "0", &screen, "-nolisten", "tcp", "-dpi", "96", "-noreset"])
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn();
        let mut server = match server {
            Ok(server) => server,
            Err(error) => {
                assert!(std::env::var_os("CI").is_none(), "Xvfb does not start: {error}");
                println!("skipped: Xvfb does not start: {error} (Debian: apt install xvfb)");
                return None;
            }
        };
        let mut number = String::new();
        BufReader::new(server.stdout.take().expect("a pipe")).read_line(&mut number).expect("the display's number");
        assert!(!number.trim().is_empty(), "Xvfb started but found no display number");
        Some(Self { server, name: format!(":{}", number.trim()) })
    }
}

impl Drop for Display {
    fn drop(&mut self) {
        let _ = self.server.kill();
        let _ = self.server.wait();
    }
}

/// The program in a folder of its own.
pub struct Program {
    child: Child,
    lines: Receiver<String>,
    /// Everything it has said on stdout so far.
    said: Vec<String>,
    /// And on stderr, which a thread reads to its end.
    errors: Arc<Mutex<String>>,
    reader: Option<JoinHandle<()>>,
}

impl Program {
    /// A scene in a window.
    pub fn start(display: &Display, folder: &Path, scene: &str, more: &[&str]) -> Self {
        let mut command = command(folder);
        command.args(["view", scene, "--on", "window", "--validate"]).args(more);
        Self::spawn(display, command)
    }

    /// Any command on a display.
    pub fn spawn(display: &Display, mut command: Command) -> Self {
        let mut child = command.env("DISPLAY", &display.name).spawn().expect("the program");
        let (sender, lines) = channel();
        let stdout = BufReader::new(child.stdout.take().expect("a pipe"));
        std::thread::spawn(move || stdout.lines().map_while(Result::ok).try_for_each(|line| sender.send(line)));
        let stderr = BufReader::new(child.stderr.take().expect("a pipe"));
        let errors = Arc::new(Mutex::new(String::new()));
        let told = Arc::clone(&errors);
        let reader = std::thread::spawn(move || {
            for line in stderr.lines().map_while(Result::ok) {
                told.lock().expect("its errors").push_str(&(line + "\n"));
            }
        });
        Self { child, lines, said: Vec::new(), errors, reader: Some(reader) }
    }

    /// What it has said on stderr so far.
    pub fn errors(&self) -> String {
        self.errors.lock().expect("its errors").clone()
    }

    /// Waits until the panel has been laid out `count` times after `before`, or for a while: not every event causes that.
    pub fn wait_for_layouts(&self, before: usize, count: usize) {
        let started = Instant::now();
        while self.layouts() < before + count && started.elapsed() < Duration::from_millis(1500) {
            std::thread::sleep(Duration::from_millis(10));
        }
    }

    /// Lines on stderr so far.
    pub fn complaints(&self) -> usize {
        self.errors().lines().count()
    }

    /// How often the panel has been laid out, as `-vv` says it.
    pub fn layouts(&self) -> usize {
        self.errors().matches("panel: laid out").count()
    }

    /// Clicks on a pixel of the window, faster than a person, and waits for what that changes in the panel.
    pub fn click(&self, hands: &Hands, at: [f64; 2]) {
        let before = self.layouts();
        hands.point(at);
        hands.button(true);
        hands.button(false);
        // One takes note of the click, the next shows what it has changed.
        self.wait_for_layouts(before, 2);
    }

    /// Waits until the panel is laid out no more, or for a while: loading is shown again and again.
    fn wait_for_rest(&self) {
        let started = Instant::now();
        let (mut layouts, mut since) = (self.layouts(), Instant::now());
        while since.elapsed() < Duration::from_millis(150) && started.elapsed() < Duration::from_millis(1500) {
            std::thread::sleep(Duration::from_millis(10));
            let now = self.layouts();
            if now != layouts {
                (layouts, since) = (now, Instant::now());
            }
        }
    }

    /// The middle of a control of the panel, pixels of the window, and its size, as `-vv` says them.
    pub fn place(&self, name: &str) -> ([f64; 2], [f64; 2]) {
        let started = Instant::now();
        loop {
            // What opens or closes above it moves it.
            self.wait_for_rest();
            let errors = self.errors();
            if let Some([middle, size]) = control_in(&errors, name) {
                return (middle, size);
            }
            assert!(started.elapsed() < Duration::from_secs(20), "no control {name} in: {errors}");
        }
    }

    /// Waits for a line on stdout that contains `part`.
    pub fn wait_for(&mut self, part: &str) -> String {
        let started = Instant::now();
        loop {
            let left = PATIENCE.saturating_sub(started.elapsed());
            let Ok(line) = self.lines.recv_timeout(left) else {
                let _ = self.child.kill();
                panic!("no `{part}` in {:?}; stderr: {}", self.said, self.errors());
            };
            self.said.push(line.clone());
            if line.contains(part) {
                return line;
            }
        }
    }

    /// Waits for a line on stdout that contains `part`, or else for a new line of `complaints`, or its end; returns whether it
    /// goes on.
    pub fn until(&mut self, part: &str, complaints: impl Fn(&str) -> usize) -> bool {
        let before = complaints(&self.errors());
        self.until_from(before, part, complaints)
    }

    /// The same after `before` complaints, counted before what may cause one.
    pub fn until_from(&mut self, before: usize, part: &str, complaints: impl Fn(&str) -> usize) -> bool {
        let started = Instant::now();
        loop {
            match self.lines.recv_timeout(Duration::from_millis(20)) {
                Ok(line) => {
                    let is_it = line.contains(part);
                    self.said.push(line);
                    if is_it {
                        return true;
                    }
                }
                Err(RecvTimeoutError::Disconnected) => return false,
                Err(RecvTimeoutError::Timeout) if complaints(&self.errors()) > before => return true,
                Err(RecvTimeoutError::Timeout) => {}
            }
            if started.elapsed() > PATIENCE {
                let _ = self.child.kill();
                panic!("no `{part}` in {:?}; stderr: {}", self.said, self.errors());
            }
        }
    }

    /// CPU time that it takes in some time, in the kernel's ticks, which are a hundredth of a second on Linux.
    pub fn cpu_ticks_in(&self, time: Duration) -> u64 {
        let used = || -> u64 {
            let stat = std::fs::read_to_string(format!("/proc/{}/stat", self.child.id())).expect("a running program");
            // Fields 14 and 15, counted from the name's closing bracket, which is field 2: proc(5).
            let fields: Vec<&str> = stat.rsplit(')').next().expect("fields").split_whitespace().collect();
            fields[11..13].iter().map(|ticks| ticks.parse::<u64>().expect("a number")).sum()
        };
        let before = used();
        std::thread::sleep(time);
        used() - before
    }

    /// Its process.
    pub fn id(&self) -> u32 {
        self.child.id()
    }

    /// What it has said on stdout, once it has ended, in whatever way.
    pub fn said_until_its_end(mut self) -> Vec<String> {
        self.child.wait().expect("a child");
        // The reader ends with the pipe.
        let rest: Vec<String> = self.lines.iter().collect();
        self.said.extend(rest);
        std::mem::take(&mut self.said)
    }

    /// Sends it a signal, by its name.
    pub fn signal(&self, name: &str) {
        signal(self.child.id(), name);
    }

    /// Whether it runs no more.
    pub fn has_ended(&mut self) -> bool {
        self.child.try_wait().expect("a child").is_some()
    }

    /// Waits for its end: exit status and stderr.
    pub fn end(mut self) -> (Option<i32>, String) {
        let started = Instant::now();
        while self.child.try_wait().expect("a child").is_none() {
            if started.elapsed() > PATIENCE {
                let _ = self.child.kill();
                panic!("it does not end");
            }
            std::thread::sleep(Duration::from_millis(20));
        }
        let code = self.child.wait().expect("a child").code();
        self.reader.take().expect("once").join().expect("its errors");
        (code, self.errors())
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        #[expect(clippy::print_stderr, reason = "the test runner shows it with the failed test")]
        if std::thread::panicking() {
            eprintln!("the program's stderr: {}", self.errors());
        }
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Numbers below what is asked for: a small generator is random enough, and always the same.
pub fn random() -> impl FnMut(u32) -> u32 {
    let mut state = 1u32;
    move |below| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 16) % below
    }
}

pub fn command(folder: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_pbr-vr"));
    command.current_dir(folder).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command.env("XDG_CACHE_HOME", folder.join("cache")).env("XDG_CONFIG_HOME", folder.join("config"));
    // Nothing of the desktop that the tests may run in.
    for name in ["DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET", "XMODIFIERS"] {
        command.env_remove(name);
    }
    command
}

/// Hands on the program's window, through a connection of its own.
pub struct Hands {
    x: RustConnection,
    root: Window,
    window: Window,
}

impl Hands {
    /// Finds the program's window: the one that is mapped. Without a window manager nothing else gives it the keyboard.
    pub fn on(display: &Display) -> Self {
        Self::find(display).expect("the program's window")
    }

    /// The same, if there is one yet.
    pub fn find(display: &Display) -> Option<Self> {
        let (x, screen) = RustConnection::connect(Some(&display.name)).expect("the display");
        let root = x.setup().roots[screen].root;
        let windows = x.query_tree(root).expect("a request").reply().expect("the windows").children;
        let is_mapped = |window: &Window| {
            let attributes = x.get_window_attributes(*window).expect("a request").reply();
            attributes.is_ok_and(|a| a.map_state == MapState::VIEWABLE)
        };
        let window = windows.into_iter().find(is_mapped)?;
        let hands = Self { x, root, window };
        hands.focus();
        Some(hands)
    }

    fn atom(&self, name: &str) -> Atom {
        self.x.intern_atom(false, name.as_bytes()).expect("a request").reply().expect("an atom").atom
    }

    fn focus(&self) {
        self.x
            .set_input_focus(InputFocus::PARENT, self.window, CURRENT_TIME)
            .expect("a request")
            .check()
            .expect("focus");
    }

    pub fn resize(&self, [width, height]: [u32; 2]) {
        let size = ConfigureWindowAux::new().width(width).height(height);
        self.x.configure_window(self.window, &size).expect("a request").check().expect("a resize");
    }

    /// Presses and releases keys together, given by the codes of a PC keyboard.
    pub fn press(&self, codes: &[u8]) {
        codes.iter().for_each(|code| self.fake(KEY_PRESS_EVENT, *code, [0, 0]));
        codes.iter().rev().for_each(|code| self.fake(KEY_RELEASE_EVENT, *code, [0, 0]));
    }

    /// Moves the pointer to a pixel of the window, which lies in the screen's corner.
    pub fn point(&self, [x, y]: [f64; 2]) {
        self.fake(MOTION_NOTIFY_EVENT, 0, [x.round() as i16, y.round() as i16]);
    }

    /// Presses or releases the left button.
    pub fn button(&self, press: bool) {
        self.fake(if press { BUTTON_PRESS_EVENT } else { BUTTON_RELEASE_EVENT }, 1, [0, 0]);
    }

    /// The XTEST extension's request FakeInput, as its specification lays it out: nine words, all but these zero.
    fn fake(&self, kind: u8, code: u8, [x, y]: [i16; 2]) {
        let xtest = self.x.extension_information("XTEST").expect("a request").expect("the XTEST extension");
        let mut request = [0; 36];
        let words = (request.len() as u16 / 4).to_ne_bytes();
        request[..6].copy_from_slice(&[xtest.major_opcode, 2, words[0], words[1], kind, code]);
        request[12..16].copy_from_slice(&self.root.to_ne_bytes());
        request[24..26].copy_from_slice(&x.to_ne_bytes());
        request[26..28].copy_from_slice(&y.to_ne_bytes());
        let sent = self.x.send_request_without_reply(&[IoSlice::new(&request)], Vec::new());
        sent.expect("a request").check().expect("an event");
    }

    /// Asks the window to close, as its frame's button does.
    pub fn close(&self) {
        let data = [self.atom("WM_DELETE_WINDOW"), CURRENT_TIME, 0, 0, 0];
        let event = ClientMessageEvent::new(32, self.window, self.atom("WM_PROTOCOLS"), data);
        let sent = self.x.send_event(false, self.window, EventMask::NO_EVENT, event);
        sent.expect("a request").check().expect("sent");
    }

    pub fn map(&self, map: bool) {
        if map {
            self.x.map_window(self.window).expect("a request").check().expect("mapping");
            self.focus();
        } else {
            self.x.unmap_window(self.window).expect("a request").check().expect("unmapping");
        }
    }

    /// Marks the window as minimised, and takes the keyboard away, as a window manager does; or the reverse.
    pub fn minimise(&self, minimise: bool) {
        let (state, hidden) = (self.atom("_NET_WM_STATE"), self.atom("_NET_WM_STATE_HIDDEN"));
        let states: &[Atom] = if minimise { &[hidden] } else { &[] };
        let set = self.x.change_property32(PropMode::REPLACE, self.window, state, AtomEnum::ATOM, states);
        set.expect("a request").check().expect("a property");
        if minimise {
            let nobody = self.x.set_input_focus(InputFocus::NONE, self.root, CURRENT_TIME);
            nobody.expect("a request").check().expect("no focus");
        } else {
            self.focus();
        }
    }

    /// The window's pixels, row by row, as 0xRRGGBB.
    pub fn look(&self, [width, height]: [u16; 2]) -> Vec<u32> {
        let format = x11rb::protocol::xproto::ImageFormat::Z_PIXMAP;
        let image =
            self.x.get_image(format, self.window, 0, 0, width, height, !0).expect("a request").reply().expect("pixels");
        image.data.chunks_exact(4).map(|p| u32::from_le_bytes([p[0], p[1], p[2], 0])).collect()
    }
}

/// A file manager with one file under the pointer: the source's side of XDND, version 5.
pub struct FileManager<'a> {
    hands: &'a Hands,
    window: Window,
}

impl<'a> FileManager<'a> {
    pub fn new(hands: &'a Hands) -> Self {
        let window = hands.x.generate_id().expect("an id");
        let (class, screen_visual) = (WindowClass::INPUT_ONLY, 0);
        let none = CreateWindowAux::new();
        hands.x.create_window(0, window, hands.root, 0, 0, 1, 1, 0, class, screen_visual, &none).expect("a window");
        Self { hands, window }
    }

    fn send(&self, message: &str, data: [u32; 4]) {
        let data = [self.window, data[0], data[1], data[2], data[3]];
        let event = ClientMessageEvent::new(32, self.hands.window, self.hands.atom(message), data);
        let target = self.hands.window;
        self.hands.x.send_event(false, target, EventMask::NO_EVENT, event).expect("a request").check().expect("sent");
    }

    /// Drags a file onto the window and lets go.
    pub fn drop(&self, file: &Path) {
        let x = &self.hands.x;
        let (selection, list) = (self.hands.atom("XdndSelection"), self.hands.atom("text/uri-list"));
        x.set_selection_owner(self.window, selection, CURRENT_TIME).expect("a request").check().expect("the selection");
        self.send("XdndEnter", [5 << 24, list, 0, 0]);
        self.send("XdndPosition", [0, 10 << 16 | 10, CURRENT_TIME, self.hands.atom("XdndActionCopy")]);
        let request = loop {
            if let Event::SelectionRequest(request) = x.wait_for_event().expect("an event") {
                break request;
            }
        };
        let uri = format!("file://{}\r\n", file.display());
        x.change_property8(PropMode::REPLACE, request.requestor, request.property, list, uri.as_bytes())
            .expect("the name");
        let answer = SelectionNotifyEvent {
            response_type: SELECTION_NOTIFY_EVENT,
            sequence: 0,
            time: request.time,
            requestor: request.requestor,
            selection: request.selection,
            target: request.target,
            property: request.property,
        };
        x.send_event(false, request.requestor, EventMask::NO_EVENT, answer).expect("a request").check().expect("sent");
        self.send("XdndDrop", [0, CURRENT_TIME, 0, 0]);
    }
}

// Codes of a PC keyboard under X: evdev's plus 8.
pub const ESCAPE: u8 = 9;
pub const TAB: u8 = 23;
pub const W: u8 = 25;
pub const P: u8 = 33;
pub const H: u8 = 43;
pub const BRACKET_RIGHT: u8 = 35;
pub const PAGE_DOWN: u8 = 117;
pub const L: u8 = 46;
pub const V: u8 = 55;
pub const C: u8 = 54;
pub const M: u8 = 58;
pub const PERIOD: u8 = 60;
