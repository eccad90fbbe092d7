//! The window end to end: the program under its own X server, with the validation layer, driven like a user would.
#![cfg(target_os = "linux")]

mod common;

use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use pbr_vr::asset::picture::{Picture, compare};
use x11rb::CURRENT_TIME;
use x11rb::connection::Connection;
use x11rb::protocol::Event;
use x11rb::protocol::xproto::{
    Atom, ClientMessageEvent, ConfigureWindowAux, ConnectionExt as _, CreateWindowAux, EventMask, InputFocus,
    KEY_PRESS_EVENT, KEY_RELEASE_EVENT, MapState, PropMode, SELECTION_NOTIFY_EVENT, SelectionNotifyEvent, Window,
    WindowClass,
};
use x11rb::protocol::xtest::ConnectionExt as _;
use x11rb::rust_connection::RustConnection;
use x11rb::wrapper::ConnectionExt as _;

use common::{Workshop, material, sphere};

const PATIENCE: Duration = Duration::from_secs(180);
const SCREEN: [u16; 2] = [2600, 2000];

/// An X server of a test's own, on a display number nobody has; it ends with the test.
struct Display {
    server: Child,
    name: String,
}

impl Display {
    /// Starts one; `None`, with the reason printed, where Xvfb is not installed. In CI that is a failure.
    fn start() -> Option<Self> {
        let screen = format!("{}x{}x24", SCREEN[0], SCREEN[1]);
        // Xvfb picks a free number itself and tells it on file descriptor 1.
        let server = Command::new("Xvfb")
            .args(["-displayfd", "1", "-screen", "0", &screen, "-nolisten", "tcp", "-dpi", "96"])
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
struct Program {
    child: Child,
    lines: Receiver<String>,
    /// Everything it has said on stdout so far.
    said: Vec<String>,
}

impl Program {
    fn start(display: &Display, folder: &Path, scene: &str, more: &[&str]) -> Self {
        let mut child = command(folder)
            .env("DISPLAY", &display.name)
            .args(["view", scene, "--on", "window", "--validate"])
            .args(more)
            .spawn()
            .expect("the program");
        let (sender, lines) = channel();
        let stdout = BufReader::new(child.stdout.take().expect("a pipe"));
        std::thread::spawn(move || stdout.lines().map_while(Result::ok).try_for_each(|line| sender.send(line)));
        Self { child, lines, said: Vec::new() }
    }

    /// Waits for a line on stdout that contains `part`.
    fn wait_for(&mut self, part: &str) -> String {
        let started = Instant::now();
        loop {
            let left = PATIENCE.saturating_sub(started.elapsed());
            let Ok(line) = self.lines.recv_timeout(left) else {
                let _ = self.child.kill();
                let mut errors = String::new();
                self.child.stderr.take().expect("a pipe").read_to_string(&mut errors).expect("its errors");
                panic!("no `{part}` in {:?}; stderr: {errors}", self.said);
            };
            self.said.push(line.clone());
            if line.contains(part) {
                return line;
            }
        }
    }

    /// Waits for its end: exit status and stderr.
    fn end(mut self) -> (Option<i32>, String) {
        let started = Instant::now();
        while self.child.try_wait().expect("a child").is_none() {
            if started.elapsed() > PATIENCE {
                let _ = self.child.kill();
                panic!("it does not end");
            }
            std::thread::sleep(Duration::from_millis(20));
        }
        let mut errors = String::new();
        self.child.stderr.take().expect("a pipe").read_to_string(&mut errors).expect("its errors");
        (self.child.wait().expect("a child").code(), errors)
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn command(folder: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_pbr-vr"));
    command.current_dir(folder).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    // Nothing of the desktop that the tests may run in.
    for name in ["DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET", "XMODIFIERS"] {
        command.env_remove(name);
    }
    command
}

/// Hands on the program's window, through a connection of its own.
struct Hands {
    x: RustConnection,
    root: Window,
    window: Window,
}

impl Hands {
    /// Finds the program's window: the one that is mapped. Without a window manager nobody else gives it the keyboard.
    fn on(display: &Display) -> Self {
        let (x, screen) = RustConnection::connect(Some(&display.name)).expect("the display");
        let root = x.setup().roots[screen].root;
        let windows = x.query_tree(root).expect("a request").reply().expect("the windows").children;
        let is_mapped = |window: &Window| {
            let attributes = x.get_window_attributes(*window).expect("a request").reply();
            attributes.is_ok_and(|a| a.map_state == MapState::VIEWABLE)
        };
        let window = windows.into_iter().find(is_mapped).expect("the program's window");
        let hands = Self { x, root, window };
        hands.focus();
        hands
    }

    fn focus(&self) {
        self.x
            .set_input_focus(InputFocus::PARENT, self.window, CURRENT_TIME)
            .expect("a request")
            .check()
            .expect("focus");
    }

    fn resize(&self, [width, height]: [u32; 2]) {
        let size = ConfigureWindowAux::new().width(width).height(height);
        self.x.configure_window(self.window, &size).expect("a request").check().expect("a resize");
    }

    /// Presses and releases keys together, given by the codes of a PC keyboard.
    fn press(&self, codes: &[u8]) {
        let send = |kind, code| {
            self.x
                .xtest_fake_input(kind, code, CURRENT_TIME, self.root, 0, 0, 0)
                .expect("a request")
                .check()
                .expect("a key");
        };
        codes.iter().for_each(|code| send(KEY_PRESS_EVENT, *code));
        codes.iter().rev().for_each(|code| send(KEY_RELEASE_EVENT, *code));
    }

    fn map(&self, map: bool) {
        if map {
            self.x.map_window(self.window).expect("a request").check().expect("mapping");
            self.focus();
        } else {
            self.x.unmap_window(self.window).expect("a request").check().expect("unmapping");
        }
    }

    /// The window's pixels, row by row, as 0xRRGGBB.
    fn look(&self, [width, height]: [u16; 2]) -> Vec<u32> {
        let format = x11rb::protocol::xproto::ImageFormat::Z_PIXMAP;
        let image =
            self.x.get_image(format, self.window, 0, 0, width, height, !0).expect("a request").reply().expect("pixels");
        image.data.chunks_exact(4).map(|p| u32::from_le_bytes([p[0], p[1], p[2], 0])).collect()
    }
}

/// A file manager with one file under the pointer: the source's side of XDND, version 5.
struct FileManager<'a> {
    hands: &'a Hands,
    window: Window,
}

impl<'a> FileManager<'a> {
    fn new(hands: &'a Hands) -> Self {
        let window = hands.x.generate_id().expect("an id");
        let (class, screen_visual) = (WindowClass::INPUT_ONLY, 0);
        let none = CreateWindowAux::new();
        hands.x.create_window(0, window, hands.root, 0, 0, 1, 1, 0, class, screen_visual, &none).expect("a window");
        Self { hands, window }
    }

    fn atom(&self, name: &str) -> Atom {
        self.hands.x.intern_atom(false, name.as_bytes()).expect("a request").reply().expect("an atom").atom
    }

    fn send(&self, message: &str, data: [u32; 4]) {
        let data = [self.window, data[0], data[1], data[2], data[3]];
        let event = ClientMessageEvent::new(32, self.hands.window, self.atom(message), data);
        let target = self.hands.window;
        self.hands.x.send_event(false, target, EventMask::NO_EVENT, event).expect("a request").check().expect("sent");
    }

    /// Drags a file onto the window and lets go.
    fn drop(&self, file: &Path) {
        let x = &self.hands.x;
        let (selection, list) = (self.atom("XdndSelection"), self.atom("text/uri-list"));
        x.set_selection_owner(self.window, selection, CURRENT_TIME).expect("a request").check().expect("the selection");
        self.send("XdndEnter", [5 << 24, list, 0, 0]);
        self.send("XdndPosition", [0, 10 << 16 | 10, CURRENT_TIME, self.atom("XdndActionCopy")]);
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
const ESCAPE: u8 = 9;
const TAB: u8 = 23;
const W: u8 = 25;
const P: u8 = 33;
const H: u8 = 43;
const BRACKET_RIGHT: u8 = 35;
const V: u8 = 55;
const C: u8 = 54;
const M: u8 = 58;
const PERIOD: u8 = 60;

/// A golden sphere under a simple sky, with two cameras.
fn small_scene() -> (Workshop, PathBuf) {
    let workshop = Workshop::new();
    workshop.panorama("sky.exr", 64, |[_, y, z]| [0.3 + 0.3 * z as f32, 0.4, 0.5 + 0.5 * y as f32]);
    workshop.write("gold.mtl", &material([1.0, 0.8, 0.3], 1.0, 0.3));
    workshop.write("ball.obj", &sphere("gold.mtl"));
    let camera = |name, x| {
        format!(
            "[[camera]]\nname = \"{name}\"\nposition = [{x}, 1, 4]\ntarget = [0, 0, 0]\nvertical_fov_degrees = 40\n"
        )
    };
    let model = "[[model]]\nfile = \"ball.obj\"\n";
    let text =
        format!("environment = {{ panorama = \"sky.exr\" }}\n{model}{}{}", camera("front", 0), camera("side", 3));
    let scene = workshop.write("scene.toml", &text);
    (workshop, scene)
}

fn assert_clean((code, errors): (Option<i32>, String)) {
    assert_eq!(code, Some(0), "{errors}");
    assert!(!errors.contains("validation"), "{errors}");
}

#[test]
fn it_opens_draws_and_ends_after_its_frames() {
    let Some(display) = Display::start() else { return };
    let (workshop, _) = small_scene();
    let mut program = Program::start(&display, workshop.0.path(), "scene.toml", &["--frames", "3"]);
    let line = program.wait_for("window");
    assert!(line.starts_with("pbr-vr: window 1280x720 on "), "{line}");
    assert_clean(program.end());
}

#[test]
fn it_survives_resizes_hiding_and_every_key() {
    let Some(display) = Display::start() else { return };
    let (workshop, _) = small_scene();
    let mut program = Program::start(&display, workshop.0.path(), "scene.toml", &[]);
    program.wait_for("window");
    let hands = Hands::on(&display);
    // A small generator of numbers is random enough and always the same.
    let mut state = 1u32;
    let mut random = |below: u32| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 16) % below
    };
    for i in 0..200 {
        hands.resize([1 + random(320), 1 + random(240)]);
        // Sometimes several resizes to a frame, sometimes several frames to a resize.
        std::thread::sleep(Duration::from_millis(u64::from(random(12))));
        match i {
            50 => hands.resize([1, 1]),
            90 => hands.resize(SCREEN.map(u32::from)),
            120 => hands.map(false),
            140 => hands.map(true),
            _ => {}
        }
        if i % 20 == 0 {
            hands.press(&[[V, M, C, H, TAB, W, BRACKET_RIGHT, PERIOD][i / 20 % 8]]);
        }
    }
    hands.resize([200, 100]);
    hands.press(&[P]);
    program.wait_for("wrote pbr-vr-1.png");
    let picture = Picture::read(&workshop.path("pbr-vr-1.png")).expect("a picture");
    assert_eq!((picture.width, picture.height), (200, 100));
    hands.press(&[ESCAPE]);
    assert_clean(program.end());
}

#[test]
fn a_screenshot_is_what_render_writes_and_keys_change_it() {
    let Some(display) = Display::start() else { return };
    let (workshop, _) = small_scene();
    let mut program = Program::start(&display, workshop.0.path(), "scene.toml", &[]);
    program.wait_for("window");
    let hands = Hands::on(&display);
    hands.press(&[P]);
    program.wait_for("wrote pbr-vr-1.png");
    hands.press(&[C]);
    hands.press(&[P]);
    program.wait_for("wrote pbr-vr-2.png");
    hands.press(&[BRACKET_RIGHT]);
    hands.press(&[P]);
    program.wait_for("wrote pbr-vr-3.png");
    // What is on the screen carries text: some pixels are white, which the scene's are not.
    let white = hands.look([300, 80]).iter().filter(|p| **p == 0xff_ffff).count();
    assert!(white > 200, "{white} white pixels where text should be");
    hands.press(&[ESCAPE]);
    assert_clean(program.end());

    let shot = |n: u32| Picture::read(&workshop.path(&format!("pbr-vr-{n}.png"))).expect("a picture");
    let rendered = |camera: &str| {
        let file = format!("{camera}.png");
        let output = command(workshop.0.path())
            .args(["render", "scene.toml", "-o", &file, "--size", "1280x720", "--camera", camera])
            .output()
            .expect("the program");
        assert!(output.status.success(), "{}", text(&output.stderr));
        Picture::read(&workshop.path(&file)).expect("a picture")
    };
    for (n, camera) in [(1, "front"), (2, "side")] {
        let difference = compare(&shot(n), &rendered(camera)).expect("two pictures of one size");
        assert!(difference.flip_mean < 1e-4, "{camera}: {difference:?}");
    }
    let apart = compare(&shot(1), &shot(2)).expect("two pictures of one size").flip_mean;
    assert!(apart > 1e-3, "the cameras look alike: {apart}");
    let mean = |picture: &Picture| picture.pixels.iter().flatten().map(|c| f64::from(*c)).sum::<f64>();
    assert!(mean(&shot(3)) > 1.02 * mean(&shot(2)), "a third of a stop brightens nothing");
}

#[test]
fn dropped_files_are_shown_or_refused_and_refusals_change_nothing() {
    let Some(display) = Display::start() else { return };
    let (workshop, _) = small_scene();
    workshop.write("broken.toml", "environment = 3\n");
    workshop.write("notes.txt", "not a scene");
    workshop.write("red.mtl", &material([0.9, 0.05, 0.05], 0.0, 0.6));
    workshop.write("red.obj", &sphere("red.mtl"));
    let text = "environment = { panorama = \"sky.exr\" }\n[[model]]\nfile = \"red.obj\"\n";
    workshop.write("red.toml", text);
    workshop.panorama("night.exr", 64, |_| [0.001, 0.001, 0.01]);
    let mut program = Program::start(&display, workshop.0.path(), "scene.toml", &[]);
    program.wait_for("window");
    let hands = Hands::on(&display);
    hands.resize([320, 200]);
    let files = FileManager::new(&hands);
    let shot = |n: u32, program: &mut Program| {
        hands.press(&[P]);
        program.wait_for(&format!("wrote pbr-vr-{n}.png"));
        Picture::read(&workshop.path(&format!("pbr-vr-{n}.png"))).expect("a picture")
    };
    let before = shot(1, &mut program);
    files.drop(&workshop.path("notes.txt"));
    files.drop(&workshop.path("broken.toml"));
    // One thread does one thing after another: this screenshot is written when the broken scene has been read.
    let after = shot(2, &mut program);
    assert_eq!(before.pixels, after.pixels, "a refused file changed the picture");
    files.drop(&workshop.path("red.toml"));
    program.wait_for("showing red.toml");
    let red = shot(3, &mut program);
    files.drop(&workshop.path("night.exr"));
    program.wait_for("lit by night.exr");
    let dark = shot(4, &mut program);
    hands.press(&[ESCAPE]);
    let (code, errors) = program.end();
    assert_eq!(code, Some(0), "{errors}");
    assert!(errors.contains("notes.txt cannot be shown") && errors.contains("broken.toml:1"), "{errors}");

    let middle = |picture: &Picture| picture.pixels[100 * 320 + 160];
    let (red, dark) = (middle(&red), middle(&dark));
    assert!(red[0] > 2.0 * red[1] && red[0] > 0.2, "not the red ball: {red:?}");
    assert!(dark.iter().sum::<f32>() < 0.5 * red.iter().sum::<f32>(), "not night: {dark:?} after {red:?}");
}

#[test]
fn without_a_display_window_fails_and_auto_writes_a_picture() {
    let (workshop, _) = small_scene();
    let run = |display: Option<&str>, on: &str| -> Output {
        let mut command = command(workshop.0.path());
        if let Some(display) = display {
            command.env("DISPLAY", display);
        }
        command.args(["view", "scene.toml", "--on", on, "--validate"]).output().expect("the program")
    };
    // Neither no display nor one that does not answer.
    for display in [None, Some(":59999")] {
        let output = run(display, "window");
        let errors = text(&output.stderr);
        assert_eq!((output.status.code(), errors.lines().count()), (Some(1), 1), "{errors}");
        assert!(errors.starts_with("pbr-vr: window: "), "{errors}");

        let output = run(display, "auto");
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
        assert!(text(&output.stdout).contains("wrote pbr-vr.png, because "), "{}", text(&output.stdout));
        let picture = Picture::read(&workshop.path("pbr-vr.png")).expect("a picture");
        assert_eq!((picture.width, picture.height), (1280, 720));
        std::fs::remove_file(workshop.path("pbr-vr.png")).expect("the picture");
    }
}

#[test]
fn a_scene_that_does_not_load_is_one_line_and_no_window_is_left() {
    let Some(display) = Display::start() else { return };
    let (workshop, _) = small_scene();
    workshop.write("broken.toml", "environment = 3\n");
    let program = Program::start(&display, workshop.0.path(), "broken.toml", &[]);
    let (code, errors) = program.end();
    assert_eq!((code, errors.lines().count()), (Some(1), 1), "{errors}");
    assert!(errors.contains("broken.toml:1"), "{errors}");
}

fn text(bytes: &[u8]) -> std::borrow::Cow<'_, str> {
    String::from_utf8_lossy(bytes)
}
