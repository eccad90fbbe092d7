//! The panel end to end: every control is clicked in the window, and the picture is checked.

use std::path::Path;
use std::time::{Duration, Instant};

use pbr_vr::asset::comparison::compare;
use pbr_vr::asset::picture::Picture;

use crate::common::{Workshop, material};
use crate::desktop::{Display, ESCAPE, H, Hands, L, P, Program, command};
use crate::window::{assert_clean, small_scene};

/// The program with its panel, and a person who uses it.
struct Visit<'a> {
    workshop: &'a Workshop,
    program: Program,
    hands: Hands,
    shots: u32,
}

impl<'a> Visit<'a> {
    fn begin(display: &Display, workshop: &'a Workshop, more: &[&str]) -> Self {
        let more = [&["--light", "open", "-vv"], more].concat();
        let mut program = Program::start(display, workshop.folder.path(), "scene.toml", &more);
        program.wait_for("window");
        Self { workshop, program, hands: Hands::on(display), shots: 0 }
    }

    fn click(&self, control: &str) {
        self.program.click(&self.hands, self.program.place(control).0);
    }

    /// Clicks on a slider, at a part of its track, which begins at its left end.
    fn slide(&self, control: &str, part: f64) {
        let ([x, y], [width, _]) = self.program.place(control);
        // The track has 140 points; the number and the label follow.
        self.program.click(&self.hands, [x - width / 2.0 + 140.0 * part, y]);
    }

    fn choose(&self, control: &str, value: &str) {
        self.click(control);
        self.click(&format!("{control}={value}"));
    }

    /// The same for a setting that takes other pipelines, which are built in the background.
    fn set(&self, control: &str, value: &str) {
        let in_use = || self.program.errors().matches("the settings are in use").count();
        let before = in_use();
        self.choose(control, value);
        let started = Instant::now();
        while in_use() == before {
            assert!(started.elapsed() < Duration::from_secs(60), "{control}={value} changes nothing");
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    fn drag(&self, from: [f64; 2], to: [f64; 2]) {
        let pause = || std::thread::sleep(Duration::from_millis(300));
        self.hands.point(from);
        pause();
        self.hands.button(true);
        pause();
        self.hands.point(to);
        pause();
        self.hands.button(false);
        pause();
    }

    /// A screenshot: of the scene alone.
    fn shot(&mut self) -> Picture {
        self.shots += 1;
        let file = format!("pbr-vr-{}.png", self.shots);
        self.hands.press(&[P]);
        self.program.wait_for(&file);
        Picture::read(&self.workshop.path(&file)).expect("a picture")
    }

    fn end(self) {
        self.hands.press(&[ESCAPE]);
        assert_clean(self.program.end());
    }
}

fn rendered(folder: &Path, more: &[&str]) -> Picture {
    let arguments = ["render", "scene.toml", "-o", "rendered.png", "--size", "1280x720", "--light", "open"];
    let output = command(folder).args(arguments).args(more).output().expect("the program");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    Picture::read(&folder.join("rendered.png")).expect("a picture")
}

fn flip(a: &Picture, b: &Picture) -> f64 {
    f64::from(compare(a, b).expect("two pictures of one size").flip_mean)
}

fn mean(picture: &Picture) -> f64 {
    picture.pixels.iter().flatten().map(|c| f64::from(*c)).sum::<f64>() / picture.pixels.len() as f64
}

#[test]
fn every_choice_changes_the_picture_as_the_command_line_does() {
    let Some(display) = Display::start() else { return };
    let (workshop, _) = small_scene();
    workshop.panorama("night.exr", 64, |_| [0.01, 0.01, 0.02]);
    let mut visit = Visit::begin(&display, &workshop, &[]);
    let folder = workshop.folder.path();
    let first = visit.shot();
    assert!(flip(&first, &rendered(folder, &[])) < 1e-4);

    visit.slide("exposure", 0.6);
    let bright = visit.shot();
    assert!(mean(&bright) > 1.3 * mean(&first), "{} after {}", mean(&bright), mean(&first));
    visit.slide("turn", 0.5);
    assert!(flip(&visit.shot(), &bright) > 1e-3, "the panorama has not turned");
    visit.click("Reset all");
    assert!(flip(&visit.shot(), &first) < 1e-6, "not as at the start");

    visit.choose("camera", "side");
    assert!(flip(&visit.shot(), &rendered(folder, &["--camera", "side"])) < 1e-4);
    visit.choose("camera", "front");
    visit.choose("light", "direct");
    visit.choose("light", "open");
    // Sections below move as those above them open; closed ones leave room for the next.
    visit.click("Light");
    visit.click("Scene");
    visit.click("Shading");
    visit.set("shading", "normal");
    assert!(flip(&visit.shot(), &rendered(folder, &["--shading", "normal"])) < 1e-4);
    visit.set("shading", "pbr");
    visit.click("Shading");
    visit.click("Quality");
    visit.set("samples a pixel", "1");
    assert!(flip(&visit.shot(), &rendered(folder, &["--samples", "1"])) < 1e-4);
    visit.choose("scale of the picture", "0.5");
    assert!(flip(&visit.shot(), &rendered(folder, &["--samples", "1", "--scale", "0.5"])) < 1e-4);
    visit.click("Reset all");
    visit.click("Quality");

    visit.click("Light");
    visit.click("night.exr");
    visit.program.wait_for("lit by night.exr");
    let night = visit.shot();
    assert!(mean(&night) < 0.5 * mean(&first), "{} after {}", mean(&night), mean(&first));
    // The playlist has the panoramas of that folder, too, and starts again after the last.
    visit.click("panorama<");
    visit.program.wait_for("lit by ");
    visit.hands.press(&[L]);
    visit.program.wait_for("lit by night.exr");
    visit.end();
}

#[test]
fn a_click_shows_the_material_there_and_its_factors_change_the_picture() {
    let Some(display) = Display::start() else { return };
    let (workshop, scene) = small_scene();
    let lamp = "[[light]]\npoint = { position = [1, 2, 2], intensity = [20, 20, 20] }\n";
    let text = std::fs::read_to_string(&scene).expect("the scene");
    std::fs::write(&scene, text + lamp).expect("a test file");
    let mut visit = Visit::begin(&display, &workshop, &[]);
    let folder = workshop.folder.path();
    let first = visit.shot();
    // Sections below have room then.
    visit.click("Light");
    visit.click("Scene");
    visit.program.click(&visit.hands, [640.0, 360.0]);
    let in_use = || visit.program.errors().matches("the settings are in use").count();
    let before = in_use();
    visit.slide("metallic", 0.5);
    let started = Instant::now();
    while in_use() == before {
        assert!(started.elapsed() < Duration::from_secs(60), "no pipelines for a material that is half a metal");
        std::thread::sleep(Duration::from_millis(20));
    }
    let half = visit.shot();
    workshop.write("gold.mtl", &material([1.0, 0.8, 0.3], 0.5, 0.3));
    // A click is a pixel or two beside the middle of the slider.
    let [changed, off] = [&first, &rendered(folder, &[])].map(|other| flip(&half, other));
    assert!(changed > 0.01 && off < 0.1 * changed, "{changed} from the start, {off} from what it is to be");

    visit.click("As in its file");
    assert!(flip(&visit.shot(), &first) < 1e-6, "not as its file has it");
    visit.slide("roughness", 0.9);
    assert!(flip(&visit.shot(), &first) > 1e-3, "no rougher");
    visit.click("Material");
    visit.click("Lamps");
    visit.click("lamp 1");
    visit.click("Reset all");
    assert!(flip(&visit.shot(), &first) < 1e-6, "not as at the start");
    visit.click("lamp 1");
    let dark = visit.shot();
    std::fs::write(&scene, std::fs::read_to_string(&scene).expect("the scene").replace(lamp, "")).expect("a test file");
    workshop.write("gold.mtl", &material([1.0, 0.8, 0.3], 1.0, 0.3));
    assert!(flip(&dark, &rendered(folder, &[])) < 1e-4, "a lamp that is off shines");
    visit.end();
}

#[test]
fn a_view_is_saved_under_a_typed_name_and_typing_gives_no_commands() {
    let Some(display) = Display::start() else { return };
    let (workshop, scene) = small_scene();
    let mut visit = Visit::begin(&display, &workshop, &[]);
    let front = visit.shot();
    // A drag over the picture orbits; one that begins on the panel does not.
    visit.drag([400.0, 300.0], [500.0, 330.0]);
    let turned = visit.shot();
    assert!(flip(&turned, &front) > 1e-3, "a drag turns nothing");
    let heading = visit.program.place("Keys").0;
    visit.drag([heading[0], heading[1] + 60.0], [heading[0] - 100.0, heading[1] + 30.0]);
    assert!(flip(&visit.shot(), &turned) < 1e-6, "a drag on the panel turns the scene");

    visit.click("view's name");
    // P would write a screenshot, H hide the panel, C change the camera.
    let (c, h, p) = (54, H, P);
    visit.hands.press(&[c]);
    visit.hands.press(&[h]);
    visit.hands.press(&[p]);
    visit.click("Save view");
    visit.program.wait_for("camera chp is in");
    let saved = visit.shot();
    assert!(flip(&saved, &turned) < 1e-6, "typing has changed the picture");
    assert!(!workshop.path("pbr-vr-5.png").exists(), "a letter was taken for a command");
    assert!(std::fs::read_to_string(scene).expect("the scene").contains("name = \"chp\""));
    visit.choose("camera", "front");
    visit.choose("camera", "chp");
    assert!(flip(&visit.shot(), &turned) < 1e-4);
    assert!(flip(&rendered(workshop.folder.path(), &["--camera", "chp"]), &turned) < 1e-4);
    visit.end();
}

#[test]
fn it_hides_and_remembers_that_and_a_still_scene_takes_no_time() {
    let Some(display) = Display::start() else { return };
    let (workshop, _) = small_scene();
    let visit = Visit::begin(&display, &workshop, &[]);
    std::thread::sleep(Duration::from_secs(2));
    // A hundredth of a core for both; the kernel's ticks are ten milliseconds.
    let time = Duration::from_secs(4);
    let ticks = visit.program.cpu_ticks_in(time);
    assert!(ticks <= 4, "{ticks} ticks at rest, with the panel");
    visit.click("Hide");
    visit.end();

    let mut visit = Visit::begin(&display, &workshop, &[]);
    std::thread::sleep(Duration::from_secs(1));
    let shot = visit.shot();
    // The message about the screenshot lies in the lower left corner.
    let look = visit.hands.look([1280, 600]);
    let same = |(i, seen): (usize, &u32)| {
        let bytes = [16, 8, 0].map(|shift| (seen >> shift & 255) as f32 / 255.0);
        (0..3).all(|channel| (bytes[channel] - shot.pixels[i][channel]).abs() < 0.01)
    };
    let different = look.iter().enumerate().filter(|pixel| !same(*pixel)).count();
    assert!(different < 100, "{different} pixels are not the scene's, although the panel is hidden");
    visit.hands.press(&[H]);
    visit.program.place("Hide");
    visit.click("Statistics");
    visit.click("draw all the time");
    let ticks = visit.program.cpu_ticks_in(Duration::from_secs(1));
    assert!(ticks >= 20, "{ticks} ticks while frames are drawn all the time");
    visit.end();
}

#[test]
fn a_thousand_panoramas_are_no_burden_and_broken_ones_change_nothing() {
    let Some(display) = Display::start() else { return };
    let (workshop, _) = small_scene();
    std::fs::write(workshop.path("a-broken.hdr"), "#?RADIANCE\n").expect("a test file");
    workshop.panorama("p0000.exr", 16, |_| [0.01, 0.01, 0.02]);
    for i in 1..1000 {
        std::fs::copy(workshop.path("p0000.exr"), workshop.path(&format!("p{i:04}.exr"))).expect("a test file");
    }
    let mut visit = Visit::begin(&display, &workshop, &[]);
    let first = visit.shot();
    visit.click("a-broken.hdr");
    // One thread loads one thing after another.
    let after = visit.shot();
    assert!(flip(&after, &first) < 1e-6, "a broken panorama has changed the picture");
    visit.click("p0000.exr");
    visit.program.wait_for("lit by p0000.exr");
    assert!(mean(&visit.shot()) < 0.5 * mean(&first));
    visit.hands.press(&[ESCAPE]);
    let (code, errors) = visit.program.end();
    assert_eq!(code, Some(0), "{errors}");
    assert!(errors.contains("pbr-vr: ") && errors.contains("a-broken.hdr"), "{errors}");
}

#[test]
fn a_drag_is_drawn_coarsely_and_the_rest_whole() {
    let Some(display) = Display::start() else { return };
    let (workshop, _) = small_scene();
    let mut visit = Visit::begin(&display, &workshop, &[]);
    visit.hands.press(&[H]);
    std::thread::sleep(Duration::from_secs(1));
    visit.hands.point([600.0, 300.0]);
    visit.hands.button(true);
    // Small steps: what is seen meanwhile is never at rest.
    let mut coarse = Vec::new();
    for i in 0..20 {
        visit.hands.point([600.0 + f64::from(i), 300.0]);
        std::thread::sleep(Duration::from_millis(100));
        coarse = visit.hands.look([1280, 600]);
    }
    std::thread::sleep(Duration::from_secs(1));
    let whole = visit.hands.look([1280, 600]);
    visit.hands.button(false);
    // Every second pixel of a coarse picture is a mean of its neighbours: steps between neighbours are smaller.
    let green = |p: &u32| f64::from(p >> 8 & 255);
    let steps = |look: &[u32]| -> f64 {
        look.chunks_exact(1280).flat_map(|row| row.windows(2)).map(|p| (green(&p[0]) - green(&p[1])).powi(2)).sum()
    };
    let mean = |look: &[u32]| look.iter().map(green).sum::<f64>() / look.len() as f64;
    assert!(steps(&coarse) < 0.8 * steps(&whole), "{} of {}", steps(&coarse), steps(&whole));
    assert!((mean(&coarse) - mean(&whole)).abs() < 0.5, "brightness jumps: {} to {}", mean(&coarse), mean(&whole));
    let shot = visit.shot();
    let shown =
        whole.iter().zip(&shot.pixels).filter(|(seen, kept)| (green(seen) - 255.0 * f64::from(kept[1])).abs() > 1.5);
    assert!(shown.count() < 100, "what is shown at rest is not the whole picture");
    visit.end();
}

#[test]
fn escape_ends_it_at_once_while_it_loads() {
    let Some(display) = Display::start() else { return };
    let (workshop, _) = small_scene();
    let mut program = command(workshop.folder.path());
    // Validation waits for everything to be destroyed.
    program.args(["view", "--on", "window", "--no-cache"]);
    let program = Program::spawn(&display, program);
    let started = Instant::now();
    let hands = loop {
        match Hands::find(&display) {
            Some(hands) => break hands,
            None => assert!(started.elapsed() < Duration::from_secs(20), "no window"),
        }
        std::thread::sleep(Duration::from_millis(50));
    };
    std::thread::sleep(Duration::from_millis(500));
    let pressed = Instant::now();
    hands.press(&[ESCAPE]);
    let (code, errors) = program.end();
    assert_eq!(code, Some(0), "{errors}");
    assert!(pressed.elapsed() < Duration::from_secs(3), "{:?}", pressed.elapsed());
}
