//! The models we make ourselves, as Wavefront OBJ and MTL text. Metres, +Y up, counter-clockwise from outside.

mod demo;
mod newell;
pub mod obj;
mod shapes;
mod sphere;
mod teapot;
mod tearoom;

/// One file to write: its path inside the assets folder, and its whole text.
pub struct File {
    pub path: &'static str,
    pub text: String,
}

/// Every model with its material library, in a fixed order.
pub fn files() -> Vec<File> {
    let model = |path, library, obj: &obj::Obj| File { path, text: obj.text(library) };
    let library = |path, materials: &[obj::Material]| File { path, text: obj::library(materials) };
    vec![
        model("scenes/sphere.obj", "sphere.mtl", &sphere::model()),
        library("scenes/sphere.mtl", &sphere::materials()),
        model("scenes/teapot.obj", "teapot.mtl", &teapot::model()),
        library("scenes/teapot.mtl", &teapot::materials()),
        model("scenes/tearoom.obj", "tearoom.mtl", &tearoom::model()),
        library("scenes/tearoom.mtl", &tearoom::materials()),
        model("scenes/demo.obj", "demo.mtl", &demo::model()),
        library("scenes/demo.mtl", &demo::materials()),
    ]
}
