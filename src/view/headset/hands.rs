//! What the user does with hands: moves through the scene, turns and grabs models, asks for other scenes; and what is drawn
//! of it.

use glam::{Mat4, Vec3};

use super::actions::{Actions, Hand, InputActions, input_table};
use super::optics::Head;
use super::rig::{Arc, Grab, Rig, SNAP_DEGREES, TeleportFade, is_object, teleport_arc, turned_models};
use super::runtime::Runtime;
use crate::asset::shipped;
use crate::render::ControllerGizmos;
use crate::view::window::loader::LoadedScene;

/// Linear display colours: wands and rays, and arcs that lead nowhere.
const LIGHT: Vec3 = Vec3::new(0.75, 0.8, 0.85);
const GO: Vec3 = Vec3::new(0.1, 0.7, 0.3);
const NO_GO: Vec3 = Vec3::new(0.8, 0.15, 0.1);
/// How far a ray reaches: it only shows where the hand points.
const RAY_METRES: f32 = 0.35;

/// What others have to do.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Requests {
    pub next_scene: bool,
    pub next_panorama: bool,
    pub next_shading: bool,
}

/// What a frame's hands come to.
pub struct Step {
    pub world_from_play: Mat4,
    /// The user stands elsewhere or looks another way than by moving the head: nothing may be guessed from the frame before.
    pub jumped: bool,
    pub requests: Requests,
}

/// The user's place and hands in the shown scene.
pub struct Hands {
    /// `None` where the runtime has no input.
    actions: Option<Actions>,
    /// `None` until the scene's first frame.
    rig: Option<Rig>,
    /// Whether the place was found from a real pose of the head.
    settled: bool,
    camera: usize,
    blink: TeleportFade,
    grab: Option<(Hand, Grab)>,
    gizmos: ControllerGizmos,
}

impl Hands {
    /// Tells the runtime of the actions; without them one can still look around.
    pub fn new(runtime: &Runtime) -> Self {
        let actions =
            actions(runtime).inspect_err(|why| crate::complain!("pbr-vr: headset: no controllers: {why}")).ok();
        let (blink, gizmos) = (TeleportFade::default(), ControllerGizmos::default());
        Self { actions, rig: None, settled: false, camera: 0, blink, grab: None, gizmos }
    }

    /// Stands at one of the scene's cameras from the next frame on; also for a new scene.
    pub fn go_to(&mut self, camera: usize) {
        (self.rig, self.settled, self.camera, self.grab) = (None, false, camera, None);
        self.blink = TeleportFade::default();
    }

    /// What is to be drawn of the hands.
    pub fn gizmos(&self) -> &ControllerGizmos {
        &self.gizmos
    }

    /// Goes on by a frame: moves user and models as asked.
    pub fn step(&mut self, stage: &mut LoadedScene, head: &Head, seconds: f32) -> Step {
        let wishes = self.actions.as_mut().map(Actions::read).unwrap_or_default();
        let play_from_head = head.space_from_head;
        let stays = self.rig.filter(|_| self.settled || !head.is_known);
        let mut rig = stays.unwrap_or_else(|| self.start(stage, &play_from_head));
        self.settled |= head.is_known;
        if wishes.reset_seated {
            rig = Rig::seated(&stage.cameras[self.camera], &play_from_head);
        }
        if self.grab.is_none() {
            rig.snap_turn(wishes.turn, &play_from_head);
        }
        if let Some(hand) = wishes.teleport
            && let Some(landing) = arc(&rig, &wishes, hand).and_then(|arc| arc.landing)
        {
            self.blink.begin(landing);
            self.actions.iter().for_each(|actions| actions.tick(hand));
        }
        let (fade, arrived) = self.blink.step(seconds);
        if let Some(landing) = arrived {
            rig.teleport(landing, &play_from_head);
        }
        stage.renderer.set_fade(fade);
        // Nothing but the above moves it.
        let jumped = stays != Some(rig);
        self.rig = Some(rig);
        self.hold(stage, &rig, &wishes);
        self.draw(&rig, &wishes);
        let InputActions { next_scene, next_panorama, next_shading, .. } = wishes;
        let requests = Requests { next_scene, next_panorama, next_shading };
        Step { world_from_play: rig.world_from_play(), jumped, requests }
    }

    fn start(&self, stage: &LoadedScene, play_from_head: &Mat4) -> Rig {
        Rig::start(&stage.cameras[self.camera], stage.floors[self.camera], play_from_head)
    }

    /// Grabbed models follow the hand; a snap turn then turns them on the spot instead of the user.
    fn hold(&mut self, stage: &mut LoadedScene, rig: &Rig, wishes: &InputActions) {
        let world_from_hand =
            |hand: Hand| wishes.hands[hand as usize].map(|play_from_hand| rig.world_from_play() * play_from_hand);
        let holds = |hand: Hand| wishes.grab[hand as usize];
        let centre = stage.bounds.centre();
        let models = stage.renderer.world_from_models();
        if let Some((hand, grab)) = self.grab.take_if(|(hand, _)| holds(*hand)) {
            let Some(place) = world_from_hand(hand) else {
                self.grab = Some((hand, grab));
                return;
            };
            *models = grab.models(&place);
            if wishes.turn != 0 {
                let degrees = -(wishes.turn as f32) * SNAP_DEGREES;
                *models = turned_models(models, models.transform_point3(centre), degrees);
            }
            self.grab = Some((hand, Grab::begin(&place, models)));
        } else if is_object(stage.bounds) {
            let hand = [Hand::Right, Hand::Left].into_iter().find(|hand| holds(*hand));
            self.grab = hand.and_then(|hand| Some((hand, Grab::begin(&world_from_hand(hand)?, models))));
        } else {
            self.grab = None;
        }
    }

    fn draw(&mut self, rig: &Rig, wishes: &InputActions) {
        self.gizmos.clear();
        for play_from_hand in wishes.hands.into_iter().flatten() {
            let world_from_hand = rig.world_from_play() * play_from_hand;
            self.gizmos.wand(&world_from_hand, LIGHT);
            self.gizmos.ray(&world_from_hand, RAY_METRES, LIGHT);
        }
        if let Some(arc) = wishes.aim.and_then(|hand| arc(rig, wishes, hand)) {
            let colour = if arc.landing.is_some() { GO } else { NO_GO };
            self.gizmos.ribbon(&arc.points, colour);
            arc.landing.into_iter().for_each(|landing| self.gizmos.ring(landing, colour));
        }
    }
}

fn arc(rig: &Rig, wishes: &InputActions, hand: Hand) -> Option<Arc> {
    let play_from_hand = wishes.hands[hand as usize]?;
    Some(teleport_arc(&(rig.world_from_play() * play_from_hand), rig.floor()))
}

/// The runtime is only borrowed to show that it is there; its owner drops this before it.
fn actions(_there: &Runtime) -> std::result::Result<Actions, String> {
    // SAFETY: the runtime is connected; `Session` lets go of the actions before it disconnects.
    let table = unsafe { input_table() }.ok_or("the runtime has no input")?;
    Actions::new(table, &shipped::folder().map_err(|e| e.to_string())?)
}
