//! Interaction by controllers: teleport, snap turns, grabbing models, requests for other scenes; and their gizmos.

use glam::{Mat4, Vec3};

use openvr_sys::VR_IVRInput_FnTable;

use super::actions::{Actions, ButtonOwner, Hand, InputActions};
use super::optics::Head;
use super::rig::{Arc, Grab, Rig, SNAP_DEGREES, TeleportFade, is_object, teleport_arc, turned_models};
use super::runtime::Runtime;
use crate::asset::shipped;
use crate::render::ControllerGizmos;
use crate::view::action::Requests;
use crate::view::shown_scene::ShownScene;

/// Linear display colours: wands and rays, and arcs without a landing.
const LIGHT: Vec3 = Vec3::new(0.75, 0.8, 0.85);
const GO: Vec3 = Vec3::new(0.1, 0.7, 0.3);
const NO_GO: Vec3 = Vec3::new(0.8, 0.15, 0.1);
/// The length of a ray, which only shows the hand's direction.
const RAY_METRES: f32 = 0.35;

/// The result of one frame of input.
pub struct Step {
    pub world_from_play: Mat4,
    /// The user was moved or turned: the compositor must not extrapolate from the frame before.
    pub jumped: bool,
    /// Darkness of the picture, 0 to 1.
    pub fade: f32,
    pub requests: Requests,
    pub panel: PanelInput,
}

/// What the hands do with the panel at the left one.
#[derive(Clone, Copy, Debug, Default)]
pub struct PanelInput {
    /// It is to be shown, or hidden again.
    pub toggled: bool,
    /// `play_from_hand` of the right hand, which points along its −Z.
    pub pointer: Option<Mat4>,
    /// The right hand does something else in the scene: aims a teleport, holds a model.
    pub is_busy: bool,
}

/// The user's place and hands in the current scene.
pub struct Hands {
    /// `None` where the runtime has no input.
    actions: Option<Actions>,
    /// `None` until the scene's first frame.
    rig: Option<Rig>,
    /// Whether the rig was placed by a real pose of the head.
    settled: bool,
    camera: usize,
    teleport_fade: TeleportFade,
    grab: Option<(Hand, Grab)>,
    gizmos: ControllerGizmos,
    /// Whether the runtime's dashboard is up.
    dashboard: bool,
    /// Whether the right hand's laser is on the panel at the left one.
    laser: bool,
}

impl Hands {
    /// Registers the actions with the runtime; without them one can still look around.
    pub fn new(runtime: &Runtime) -> Self {
        let actions =
            actions(runtime).inspect_err(|why| crate::complain!("pbr-vr: headset: no controllers: {why}")).ok();
        let (teleport_fade, gizmos) = (TeleportFade::default(), ControllerGizmos::default());
        let (dashboard, laser) = (false, false);
        Self { actions, rig: None, settled: false, camera: 0, teleport_fade, grab: None, gizmos, dashboard, laser }
    }

    /// Moves the user to one of the scene's cameras with the next frame; also for a new scene.
    pub fn go_to(&mut self, camera: usize) {
        (self.rig, self.settled, self.camera, self.grab) = (None, false, camera, None);
        self.teleport_fade = TeleportFade::default();
    }

    /// Notes that the runtime's dashboard was opened or closed: while it is up, buttons are its own.
    pub fn follow_dashboard(&mut self, up: bool) {
        self.dashboard = up;
    }

    /// Notes whether the laser mouse is on the panel at the left hand: meanwhile buttons are its own.
    pub fn follow_laser(&mut self, on: bool) {
        self.laser = on;
    }

    /// The gizmos to draw.
    pub fn gizmos(&self) -> &ControllerGizmos {
        &self.gizmos
    }

    /// Reads this frame's input; moves the user and the models accordingly. `seconds` have passed since the last frame.
    pub fn step(&mut self, runtime: &Runtime, scene: &mut ShownScene, head: &Head, seconds: f32) -> Step {
        let table = runtime.input();
        let owner = match (self.dashboard, self.laser) {
            (true, _) => ButtonOwner::Dashboard,
            (false, true) => ButtonOwner::Laser,
            (false, false) => ButtonOwner::Scene,
        };
        let input = self.actions.as_mut().zip(table).map(|(actions, table)| actions.read(table, owner));
        let input = input.unwrap_or_default();
        let play_from_head = head.space_from_head;
        let stays = self.rig.filter(|_| self.settled || !head.is_known);
        let mut rig = stays.unwrap_or_else(|| self.start(scene, &play_from_head));
        self.settled |= head.is_known;
        if input.reset_seated {
            rig = Rig::seated(&scene.loaded.cameras[self.camera], &play_from_head);
        }
        if self.grab.is_none() {
            rig.snap_turn(input.turn, &play_from_head);
        }
        if let Some(hand) = input.teleport
            && let Some(landing) = arc(&rig, &input, hand).and_then(|arc| arc.landing)
        {
            self.teleport_fade.begin(landing);
            self.tick(table, hand);
        }
        let (fade, arrived) = self.teleport_fade.step(seconds);
        if let Some(landing) = arrived {
            rig.teleport(landing, &play_from_head);
        }
        // Only the above moves the rig.
        let jumped = stays != Some(rig);
        self.rig = Some(rig);
        self.hold(scene, &rig, &input);
        self.draw(&rig, &input);
        let InputActions { next_scene, next_panorama, next_shading, .. } = input;
        let requests = Requests { next_scene, next_panorama, next_shading };
        let right = Hand::Right as usize;
        let is_busy = input.grab[right] || input.aim == Some(Hand::Right);
        let panel = PanelInput { toggled: input.panel, pointer: input.hands[right], is_busy };
        Step { world_from_play: rig.world_from_play(), jumped, fade, requests, panel }
    }

    fn start(&self, scene: &ShownScene, play_from_head: &Mat4) -> Rig {
        Rig::start(&scene.loaded.cameras[self.camera], scene.loaded.floors[self.camera], play_from_head)
    }

    fn tick(&self, table: Option<&VR_IVRInput_FnTable>, hand: Hand) {
        if let (Some(actions), Some(table)) = (&self.actions, table) {
            actions.tick(table, hand);
        }
    }

    /// Grabbed models follow the hand; a snap turn then turns them on the spot instead of the user.
    fn hold(&mut self, scene: &mut ShownScene, rig: &Rig, input: &InputActions) {
        let world_from_hand =
            |hand: Hand| input.hands[hand as usize].map(|play_from_hand| rig.world_from_play() * play_from_hand);
        let holds = |hand: Hand| input.grab[hand as usize];
        let centre = scene.loaded.bounds.centre();
        let models = &mut scene.world_from_models;
        if let Some((hand, grab)) = self.grab.take_if(|(hand, _)| holds(*hand)) {
            let Some(place) = world_from_hand(hand) else {
                self.grab = Some((hand, grab));
                return;
            };
            *models = grab.models(&place);
            if input.turn != 0 {
                let degrees = -(input.turn as f32) * SNAP_DEGREES;
                *models = turned_models(models, models.transform_point3(centre), degrees);
            }
            self.grab = Some((hand, Grab::begin(&place, models)));
        } else if is_object(scene.loaded.bounds) {
            let hand = [Hand::Right, Hand::Left].into_iter().find(|hand| holds(*hand));
            self.grab = hand.and_then(|hand| Some((hand, Grab::begin(&world_from_hand(hand)?, models))));
        } else {
            self.grab = None;
        }
    }

    fn draw(&mut self, rig: &Rig, input: &InputActions) {
        self.gizmos.clear();
        for play_from_hand in input.hands.into_iter().flatten() {
            let world_from_hand = rig.world_from_play() * play_from_hand;
            self.gizmos.wand(&world_from_hand, LIGHT);
            self.gizmos.ray(&world_from_hand, RAY_METRES, LIGHT);
        }
        if let Some(arc) = input.aim.and_then(|hand| arc(rig, input, hand)) {
            let colour = if arc.landing.is_some() { GO } else { NO_GO };
            self.gizmos.ribbon(&arc.points, colour);
            arc.landing.into_iter().for_each(|landing| self.gizmos.ring(landing, colour));
        }
    }
}

fn arc(rig: &Rig, input: &InputActions, hand: Hand) -> Option<Arc> {
    let play_from_hand = input.hands[hand as usize]?;
    Some(teleport_arc(&(rig.world_from_play() * play_from_hand), rig.floor()))
}

fn actions(runtime: &Runtime) -> std::result::Result<Actions, String> {
    let table = runtime.input().ok_or("the runtime has no input")?;
    Actions::new(table, &shipped::folder().map_err(|e| e.to_string())?)
}
