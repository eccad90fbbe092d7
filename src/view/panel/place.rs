//! Where controls are, for tests and for reports of defects: `-vv` says it.

use egui::{Id, Rect, Response, Ui};

/// Notes where a control is on the screen; logs it where it has moved.
pub fn place(ui: &Ui, name: &str, response: &Response) {
    let pixels = response.rect * ui.ctx().pixels_per_point();
    let id = Id::new("place").with(name);
    let moved = ui.ctx().data_mut(|data| data.get_temp::<Rect>(id) != Some(pixels));
    if moved && ui.is_rect_visible(response.rect) {
        ui.ctx().data_mut(|data| data.insert_temp(id, pixels));
        let (corner, size) = (pixels.min, pixels.size());
        tracing::debug!("panel: {name} at {:.0},{:.0} {:.0}x{:.0}", corner.x, corner.y, size.x, size.y);
    }
}
