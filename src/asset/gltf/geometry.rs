//! Primitives of meshes as triangles: attributes read, deformed, and completed with normals.

use glam::{Vec2, Vec3, Vec4};

use super::accessor::Elements;
use super::deform::{Morph, Moved, Skinned, attribute};
use super::document::Primitive;
use super::draco;
use super::extensions;
use super::maps::Coordinates;
use super::materials::Materials;
use super::source::Source;
use super::triangles::{Mode, triangles};
use crate::Result;
use crate::asset::mesh::{Corner, CornerExtra, MAX_COORDINATE, Submesh};
use crate::asset::normals;

/// The most triangles of all meshes together: 1.5 GB of corners.
pub const MAX_TRIANGLES: usize = 16 << 20;
/// The most vertices that morph targets move, each counted as often as it is moved.
const MAX_MORPHED: usize = 1 << 28;

/// A primitive to be read.
#[derive(Clone, Copy)]
pub struct Wanted<'a> {
    pub primitive: &'a Primitive,
    /// Its mesh and its number in words.
    pub of: &'a str,
    pub name: &'a str,
    pub weights: &'a [f32],
    /// The matrices of a skin's joints.
    pub joints: Option<&'a [glam::DAffine3]>,
}

/// What has been read so far.
#[derive(Default)]
pub struct Read {
    pub materials: Materials,
    triangles: usize,
    morphed: usize,
}

impl Read {
    /// Counts triangles that are kept.
    ///
    /// # Errors
    /// They are too many.
    pub fn count(&mut self, source: &Source<'_>, more: usize) -> Result<()> {
        self.triangles = self.triangles.saturating_add(more);
        if self.triangles > MAX_TRIANGLES {
            return Err(
                source.too_large(format!("over {MAX_TRIANGLES} triangles"), format!("{MAX_TRIANGLES} triangles"))
            );
        }
        Ok(())
    }

    /// A primitive's triangles, those of different materials apart; none if it has none.
    ///
    /// # Errors
    /// It is not as it should be, or too large.
    pub fn primitive(&mut self, source: &Source<'_>, wanted: &Wanted<'_>) -> Result<Vec<Submesh>> {
        let Wanted { primitive, of, .. } = *wanted;
        let Some(mode) = Mode::of(source, of, primitive.mode)? else {
            source.warn_once("points", &format!("{of}: points and lines are not drawn"));
            return Ok(Vec::new());
        };
        // What is compressed is a list, whatever it was before.
        let mode = if draco::unpack(source, of, primitive, MAX_TRIANGLES)? { Mode::List } else { mode };
        let Some(positions) = primitive.attributes.get("POSITION") else {
            source.warn_once("no positions", &format!("{of}: it has no positions; left out"));
            return Ok(Vec::new());
        };
        let positions: Elements<'_, 3> = Elements::of(source, *positions)?;
        let indices: Option<Elements<'_, 1>> =
            primitive.indices.map(|index| Elements::of(source, index)).transpose()?;
        if indices.as_ref().is_some_and(|indices| !indices.has_indices()) {
            return Err(source.broken(format!("{of}: its indices are of no usable type")));
        }
        let corners = indices.as_ref().map_or(positions.count, |indices| indices.count);
        self.count(source, mode.triangles(corners))?;
        let triangles = triangles(source, of, mode, indices.as_ref(), positions.count)?;
        if triangles.is_empty() {
            return Ok(Vec::new());
        }
        extensions::warn_of_variants(source, of, primitive);
        let (material, coordinates) = match primitive.material {
            Some(index) => self.materials.get(source, index).map(|(index, chosen)| (Some(index), chosen))?,
            None => (None, [None; 2]),
        };
        let attributes = Attributes::of(source, wanted, positions, coordinates)?;
        self.morphed = self.morphed.saturating_add((3 * triangles.len()).saturating_mul(attributes.morph.targets()));
        if self.morphed > MAX_MORPHED {
            return Err(source.too_large(format!("over {MAX_MORPHED} morphed vertices"), format!("{MAX_MORPHED}")));
        }
        Ok(self.materials.split(attributes.submesh(source, wanted, material, &triangles)?))
    }
}

/// Colours of three or four numbers.
enum Colours<'a> {
    Rgb(Elements<'a, 3>),
    Rgba(Elements<'a, 4>),
}

impl Colours<'_> {
    fn get(&self, vertex: usize) -> Vec4 {
        let colour = match self {
            Self::Rgb(colours) => Vec3::from(colours.get(vertex)).extend(1.0),
            Self::Rgba(colours) => Vec4::from(colours.get(vertex)),
        };
        if colour.is_finite() { colour.clamp(Vec4::ZERO, Vec4::ONE) } else { Vec4::ONE }
    }
}

/// The attributes of a primitive's vertices.
struct Attributes<'a> {
    positions: Elements<'a, 3>,
    normals: Option<Elements<'a, 3>>,
    tangents: Option<Elements<'a, 4>>,
    uvs: [Option<(Elements<'a, 2>, Coordinates)>; 2],
    colours: Option<Colours<'a>>,
    morph: Morph<'a>,
    skin: Option<Skinned<'a>>,
}

impl<'a> Attributes<'a> {
    fn of(
        source: &'a Source<'_>,
        wanted: &Wanted<'a>,
        positions: Elements<'a, 3>,
        coordinates: [Option<Coordinates>; 2],
    ) -> Result<Self> {
        let Wanted { primitive, of, weights, joints, .. } = *wanted;
        let (given, count) = (&primitive.attributes, positions.count);
        let normals = attribute(source, of, given, "NORMAL", count)?;
        // Tangents without normals would not fit those that are computed.
        let tangents = if normals.is_some() { attribute(source, of, given, "TANGENT", count)? } else { None };
        let [first, second] = coordinates;
        let uvs = [
            uvs(source, wanted, first, Some(Coordinates::plain(0)), count)?,
            uvs(source, wanted, second, None, count)?,
        ];
        let skin = match joints {
            Some(matrices) => Skinned::of(source, of, given, count, matrices)?,
            None => None,
        };
        let morph = Morph::of(source, of, &primitive.targets, weights, count)?;
        let colours = colours(source, wanted, count)?;
        Ok(Self { positions, normals, tangents, uvs, colours, morph, skin })
    }

    fn submesh(
        &self,
        source: &Source<'_>,
        wanted: &Wanted<'_>,
        material: Option<usize>,
        triangles: &[[usize; 3]],
    ) -> Result<Submesh> {
        let mut submesh = Submesh {
            name: wanted.name.to_owned(),
            material,
            has_uvs: self.uvs[0].is_some(),
            corners: Vec::with_capacity(3 * triangles.len()),
            // Without normals, each triangle is flat.
            smoothing: if self.normals.is_none() { vec![0; triangles.len()] } else { Vec::new() },
            extras: Vec::new(),
        };
        let has_extras = self.tangents.is_some() || self.colours.is_some() || self.uvs[1].is_some();
        for [a, b, c] in triangles {
            let [a, b, c] =
                [self.vertex(source, wanted, *a)?, self.vertex(source, wanted, *b)?, self.vertex(source, wanted, *c)?];
            let triangle = if a.2 { [a, c, b] } else { [a, b, c] };
            submesh.corners.extend(triangle.iter().map(|(corner, ..)| *corner));
            if has_extras {
                submesh.extras.extend(triangle.iter().map(|(_, extra, _)| *extra));
            }
        }
        normals::complete(std::slice::from_mut(&mut submesh));
        Ok(submesh)
    }

    /// A vertex, and whether its triangles are mirrored.
    fn vertex(&self, source: &Source<'_>, wanted: &Wanted<'_>, vertex: usize) -> Result<(Corner, CornerExtra, bool)> {
        let of = wanted.of;
        let tangent = self.tangents.as_ref().map_or(Vec4::ZERO, |tangents| Vec4::from(tangents.get(vertex)));
        let normal = self.normals.as_ref().map_or(Vec3::ZERO, |normals| Vec3::from(normals.get(vertex)));
        let position = Vec3::from(self.positions.get(vertex));
        let mut moved = Moved { position, normal, tangent: tangent.truncate(), mirrored: false };
        self.morph.apply(vertex, &mut moved);
        if let Some(skin) = &self.skin {
            let applied = skin.apply(vertex, &mut moved);
            applied.ok_or_else(|| source.broken(format!("{of}: a vertex belongs to a joint that its skin has not")))?;
        }
        // NaN is not within either.
        if !moved.position.to_array().iter().all(|number| number.abs() <= MAX_COORDINATE) {
            return Err(source.broken(format!("{of}: a position is not a number, or beyond {MAX_COORDINATE:e}")));
        }
        let sign = if (tangent.w < 0.0) != moved.mirrored { -1.0 } else { 1.0 };
        let direction = normals::unit(moved.tangent);
        let extra = CornerExtra {
            uv1: self.uv(1, vertex),
            colour: self.colours.as_ref().map_or(Vec4::ONE, |colours| colours.get(vertex)),
            tangent: if direction == Vec3::ZERO { Vec4::ZERO } else { direction.extend(sign) },
        };
        let normal = if self.normals.is_some() { normals::unit(moved.normal) } else { Vec3::ZERO };
        Ok((Corner { position: moved.position, normal, uv: self.uv(0, vertex) }, extra, moved.mirrored))
    }

    fn uv(&self, number: usize, vertex: usize) -> Vec2 {
        self.uvs[number].as_ref().map_or(Vec2::ZERO, |(uvs, coordinates)| coordinates.apply(uvs.get(vertex)))
    }
}

/// The texture coordinates that a material needs, else those of `usual` if they are there.
fn uvs<'a>(
    source: &'a Source<'_>,
    wanted: &Wanted<'_>,
    needed: Option<Coordinates>,
    usual: Option<Coordinates>,
    count: usize,
) -> Result<Option<(Elements<'a, 2>, Coordinates)>> {
    let Some(coordinates) = needed.or(usual) else { return Ok(None) };
    let key = format!("TEXCOORD_{}", coordinates.set);
    let uvs = attribute(source, wanted.of, &wanted.primitive.attributes, &key, count)?;
    if uvs.is_none() && needed.is_some() {
        source.warn_once("no uvs", &format!("{}: it has no {key}, which its material needs; set to 0", wanted.of));
    }
    Ok(uvs.map(|uvs| (uvs, coordinates)))
}

fn colours<'a>(source: &'a Source<'_>, wanted: &Wanted<'_>, count: usize) -> Result<Option<Colours<'a>>> {
    let key = "COLOR_0";
    let given = &wanted.primitive.attributes;
    let accessor = given.get(key).and_then(|index| source.document.accessors.get(*index));
    if accessor.is_some_and(|accessor| accessor.kind == "VEC3") {
        let rgb = attribute(source, wanted.of, given, key, count)?;
        return Ok(rgb.map(Elements::normalized).map(Colours::Rgb));
    }
    Ok(attribute(source, wanted.of, given, key, count)?.map(Elements::normalized).map(Colours::Rgba))
}
