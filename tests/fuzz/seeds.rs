//! What is damaged: small files of every format, written here and by the encoders of other crates, and shipped ones.

use std::io::Cursor;
use std::path::Path;

use base64::Engine as _;
use exr::prelude::{
    AnyChannel, AnyChannels, Blocks, Compression, Encoding, FlatSamples, Image, Layer, LayerAttributes, LineOrder,
    SpecificChannels, Vec2, WritableImage,
};
use image::codecs::{jpeg::JpegEncoder, png};
use image::{DynamicImage, ImageFormat};
use serde_json::{Value, json};

use super::formats::{png_chunks, png_of};
use crate::asset::gltf::build_tests::glb as container;
use crate::asset::ktx2::{Ktx2, TexelFormat};

pub const OBJ: &str = "# corners
mtllib good.mtl
o one
v -1 -1 0
v 1 -1 0 0.5 0.25 1
v 1 1 0
v -1 1 0.5
v 0 2 1
vt 0 0
vt 1 0
vt 1 1 0
vt 0 1
vn 0 0 1
vn 0 0.6 0.8
g first
s 1
usemtl mapped
f 1/1/1 2/2/1 3/3/1 4/4/2
f 4 3 5
s off
usemtl plain
f -1//-1 -2//-2 -3//-2
f 1/1 2/2 5/3 4/4 3/1
p 1
l 1 2
";

pub const MTL: &str = "newmtl plain
Kd 0.5 0.25 0.125
Ke 1 2 3
Pr 0.5
Pm 1
d 0.5
illum 2
newmtl mapped
Kd 1 1 1
Ns 200
Ks 0.1 0.1 0.1
map_Kd -s 2 2 1 -o 0.5 0 0 good.png
map_d -imfchan m good.png
norm good.png
map_Bump -bm 0.5 good.tga
map_Pr -imfchan g good.jpg
map_Pm good.png
map_Ke good.png
Tr 0.1
";

/// A description of everything that there can be.
const SCENE: &str = "exposure_ev = -1.5
floor = true

[environment]
panorama = \"good.hdr\"
rotation_degrees = 90

[[model]]
file = \"good.obj\"
translation = [1, 2.5, -3]
rotation_degrees = [0, 45, 0]
scale = 0.5

[[model]]
file = 'good.glb'

[[light]]
point = { position = [0, 1, 0], intensity = [1.0, 2.0, 3e0], radius = 0.1 }

[[probe]]
position = [0, 1, 0]
box = [[-1, 0, -1], [1, 2, 1]]

[[camera]]
name = \"first\"
position = [0, 1, 4]
target = [0, 0.5, 0]
vertical_fov_degrees = 30
";

/// Flat, run-length coded, and with the old coding; exposure and colours corrected.
pub fn hdrs() -> Vec<Vec<u8>> {
    let texels: Vec<_> = (0..16 * 8).map(|i| image::Rgb([i as f32, 0.5, 1000.0 / (1.0 + i as f32)])).collect();
    let mut coded = Vec::new();
    image::codecs::hdr::HdrEncoder::new(&mut coded).encode(&texels, 16, 8).unwrap();
    let head =
        b"#?RADIANCE\n# made by hand\nEXPOSURE=2\nCOLORCORR=1 0.5 2\nFORMAT=32-bit_rle_rgbe\n\n-Y 2 +X 4\n".to_vec();
    let flat = [head.clone(), vec![128; 32]].concat();
    let runs = [head, vec![9, 9, 9, 128, 1, 1, 1, 3, 5, 6, 7, 129, 1, 1, 1, 1, 8, 8, 8, 127, 4, 4, 4, 126]].concat();
    vec![coded, flat, runs]
}

/// Every compression, tiles with levels, one channel, and two layers.
pub fn exrs() -> Vec<Vec<u8>> {
    use Compression as C;
    let pixel = |p: Vec2<usize>| (exr::prelude::f16::from_f32(p.x() as f32), 0.5 * p.y() as f32, 7u32);
    let mut files = Vec::new();
    let mut add = |encoding, size| {
        let channels =
            SpecificChannels::build().with_channel("R").with_channel("G").with_channel("B").with_pixel_fn(pixel);
        let mut bytes = Cursor::new(Vec::new());
        let image = Image::from_layer(Layer::new(size, LayerAttributes::default(), encoding, channels));
        image.write().non_parallel().to_buffered(&mut bytes).unwrap();
        files.push(bytes.into_inner());
    };
    let all = [
        C::Uncompressed,
        C::RLE,
        C::ZIP1,
        C::ZIP16,
        C::PIZ,
        C::PXR24,
        C::B44,
        C::B44A,
        C::DWAA(None),
        C::DWAB(Some(9.0)),
    ];
    for compression in all {
        add(Encoding { compression, ..Encoding::FAST_LOSSLESS }, (10, 5));
    }
    for compression in [C::Uncompressed, C::PIZ, C::B44, C::DWAA(None)] {
        add(Encoding { compression, blocks: Blocks::Tiles(Vec2(8, 4)), line_order: LineOrder::Unspecified }, (20, 10));
    }
    files.push(exr_of(&["Y", "A"]));
    let layers: exr::image::Layers<_> =
        [layer("first", &["Z"]), layer("second", &["R", "G", "B", "light.R"])].into_iter().collect();
    let mut parts = Cursor::new(Vec::new());
    Image::from_layers(exr::prelude::ImageAttributes::with_size((4, 2)), layers)
        .write()
        .non_parallel()
        .to_buffered(&mut parts)
        .unwrap();
    files.push(parts.into_inner());
    files
}

fn layer(name: &str, channels: &[&str]) -> Layer<AnyChannels<FlatSamples>> {
    let list = channels.iter().map(|name| AnyChannel::new(*name, FlatSamples::F32(vec![0.25; 8]))).collect();
    Layer::new((4, 2), LayerAttributes::named(name), Encoding::UNCOMPRESSED, AnyChannels::sort(list))
}

/// One layer of these channels.
pub fn exr_of(channels: &[&str]) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    Image::from_layer(layer("one", channels)).write().non_parallel().to_buffered(&mut bytes).unwrap();
    bytes.into_inner()
}

fn colours(width: u32, height: u32) -> DynamicImage {
    let at = |x: u32, y: u32| image::Rgba([(11 * x) as u8, (12 * y) as u8, 200, (255 - 9 * x) as u8]);
    image::RgbaImage::from_fn(width, height, at).into()
}

/// Every type of colour and depth, with and without compression, a palette, and interlacing.
pub fn pngs() -> Vec<Vec<u8>> {
    let mut files = Vec::new();
    let picture = colours(6, 5);
    let all: [DynamicImage; 6] = [
        picture.to_luma8().into(),
        picture.to_luma_alpha8().into(),
        picture.to_rgb8().into(),
        picture.clone(),
        picture.to_luma16().into(),
        picture.to_rgba16().into(),
    ];
    for image in all {
        for kind in [png::CompressionType::Best, png::CompressionType::Uncompressed] {
            let mut bytes = Vec::new();
            let encoder = png::PngEncoder::new_with_quality(&mut bytes, kind, png::FilterType::Adaptive);
            image.write_with_encoder(encoder).unwrap();
            files.push(bytes);
        }
    }
    let mut chunks = png_chunks(&files[1]);
    chunks[0].1[9] = 3;
    let palette: Vec<u8> = (0..=255u8).flat_map(|i| [i, 255 - i, i / 2]).collect();
    chunks.insert(1, (*b"PLTE", palette));
    chunks.insert(2, (*b"tRNS", vec![0, 100, 200]));
    chunks.insert(1, (*b"gAMA", vec![0, 0, 0xb1, 0x8f]));
    files.push(png_of(&chunks));
    // More bytes than a smaller picture needs.
    let mut chunks = png_chunks(&files[5]);
    chunks[0].1[3] = 4;
    chunks[0].1[7] = 3;
    chunks[0].1[12] = 1;
    files.push(png_of(&chunks));
    files
}

pub fn jpegs() -> Vec<Vec<u8>> {
    let of = |image: DynamicImage, quality| {
        let mut bytes = Vec::new();
        image.write_with_encoder(JpegEncoder::new_with_quality(&mut bytes, quality)).unwrap();
        bytes
    };
    let grey = colours(20, 20).to_luma8().into();
    vec![of(colours(20, 18).to_rgb8().into(), 90), of(grey, 50), of(colours(9, 9).to_rgb8().into(), 100)]
}

/// Plain ones, and one with runs and one with a palette, made by hand.
pub fn tgas() -> Vec<Vec<u8>> {
    let mut files = Vec::new();
    for image in [colours(5, 4), colours(5, 4).to_rgb8().into(), colours(5, 4).to_luma8().into()] {
        let mut bytes = Cursor::new(Vec::new());
        image.write_to(&mut bytes, ImageFormat::Tga).unwrap();
        files.push(bytes.into_inner());
    }
    let head = |kind: u8, depth: u8, palette: [u8; 6]| {
        let [mapped, low, high, first, count, bits] = palette;
        vec![0, mapped, kind, low, high, first, count, bits, 0, 0, 0, 0, 4, 0, 2, 0, depth, 0x20]
    };
    files.push([head(10, 24, [0; 6]), vec![0x83, 1, 2, 3, 0x03, 9, 9, 9, 8, 8, 8, 7, 7, 7, 6, 6, 6]].concat());
    files.push([head(1, 8, [1, 0, 0, 2, 0, 24]), vec![1, 2, 3, 4, 5, 6], vec![0, 1, 0, 1, 1, 0, 1, 0]].concat());
    files
}

/// The lossless and the lossy kind, with and without alpha; the lossy one of 5x4 was made by libwebp.
pub fn webps() -> Vec<Vec<u8>> {
    let mut files = vec![LOSSY_WEBP.to_vec()];
    for image in [colours(5, 4), colours(5, 4).to_rgb8().into()] {
        let mut bytes = Cursor::new(Vec::new());
        image.write_to(&mut bytes, ImageFormat::WebP).unwrap();
        files.push(bytes.into_inner());
    }
    files
}

const LOSSY_WEBP: [u8; 128] = [
    82, 73, 70, 70, 120, 0, 0, 0, 87, 69, 66, 80, 86, 80, 56, 88, 10, 0, 0, 0, 16, 0, 0, 0, 4, 0, 0, 3, 0, 0, 65, 76,
    80, 72, 21, 0, 0, 0, 0, 255, 235, 215, 195, 175, 255, 235, 215, 195, 175, 255, 235, 215, 195, 175, 255, 235, 215,
    195, 175, 0, 86, 80, 56, 32, 60, 0, 0, 0, 208, 1, 0, 157, 1, 42, 5, 0, 4, 0, 2, 192, 76, 37, 176, 2, 116, 1, 14,
    254, 3, 142, 0, 0, 254, 210, 109, 8, 153, 247, 77, 230, 85, 41, 41, 19, 49, 193, 185, 151, 221, 210, 47, 189, 35,
    123, 189, 121, 238, 13, 81, 194, 193, 191, 199, 3, 100, 128, 0, 0,
];

pub fn ktx2s() -> Vec<Vec<u8>> {
    let of = |format: TexelFormat, size, layers, faces, levels: u32| {
        let mut texture = Ktx2 { format, size, layers, faces, levels: Vec::new(), key_values: [].into() };
        texture.levels = (0..levels).map(|level| vec![level as u8; texture.level_bytes(level) as usize]).collect();
        texture.set_text("pbrvrKey", "a");
        texture.set_text("pbrvrTexels", "0");
        texture.to_bytes(Path::new("a.ktx2")).unwrap()
    };
    vec![
        of(TexelFormat::Rgba16Float, [4, 4], 0, 6, 3),
        of(TexelFormat::Bc7Srgb, [9, 6], 0, 1, 4),
        of(TexelFormat::Rg32Float, [3, 5], 2, 1, 1),
    ]
}

/// A model with what needs code of its own: maps, several sets of coordinates, colours, skins, morph targets, sparse
/// accessors, strips, compressed views, lights, cameras.
pub struct Model {
    json: Value,
    bytes: Vec<u8>,
}

impl Model {
    fn view(&mut self, bytes: &[u8]) -> usize {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let view = json!({"buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len()});
        self.bytes.extend(bytes);
        self.push("bufferViews", view)
    }

    fn push(&mut self, list: &str, entry: Value) -> usize {
        let list = self.json[list].as_array_mut().unwrap();
        list.push(entry);
        list.len() - 1
    }

    fn accessor(&mut self, kind: &str, component: u32, count: usize, bytes: &[u8]) -> usize {
        let view = self.view(bytes);
        self.push("accessors", json!({"bufferView": view, "componentType": component, "count": count, "type": kind}))
    }

    fn floats(&mut self, kind: &str, width: usize, values: &[f32]) -> usize {
        self.accessor(kind, 5126, values.len() / width, bytemuck::cast_slice(values))
    }

    fn of_everything() -> Self {
        let lists = ["nodes", "meshes", "accessors", "bufferViews", "materials", "textures", "images", "samplers"];
        let mut json = json!({"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0, 2, 3, 4, 5]}]});
        lists.iter().for_each(|list| json[list] = json!([]));
        let mut model = Self { json, bytes: Vec::new() };
        let quad = [-1f32, -1.0, 0.0, 1.0, -1.0, 0.0, 1.0, 1.0, 0.0, -1.0, 1.0, 0.5];
        let position = model.floats("VEC3", 3, &quad);
        let normal = model.floats("VEC3", 3, &[0.0, 0.0, 1.0].repeat(4));
        let tangent = model.floats("VEC4", 4, &[1.0, 0.0, 0.0, -1.0].repeat(4));
        let uv = model.floats("VEC2", 2, &[0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0, 1.0]);
        let uv1 = model.accessor("VEC2", 5123, 4, bytemuck::cast_slice(&[0u16, 0, 65535, 0, 65535, 65535, 0, 65535]));
        model.json["accessors"][uv1]["normalized"] = json!(true);
        let colour = model.accessor("VEC4", 5121, 4, &[255, 0, 128, 200].repeat(4));
        model.json["accessors"][colour]["normalized"] = json!(true);
        let indices = model.accessor("SCALAR", 5123, 6, bytemuck::cast_slice(&[0u16, 1, 2, 0, 2, 3]));
        let joints = model.accessor("VEC4", 5121, 4, &[0, 1, 0, 0].repeat(4));
        let weights = model.floats("VEC4", 4, &[0.5, 0.5, 0.0, 0.0].repeat(4));
        let moved = model.floats("VEC3", 3, &[0.0, 0.0, 0.25].repeat(4));
        let (sparse_at, sparse_values) = (model.view(&[1, 3]), model.view(bytemuck::cast_slice(&[9f32; 6])));
        model.json["accessors"][moved]["sparse"] = json!({
            "count": 2, "indices": {"bufferView": sparse_at, "componentType": 5121}, "values": {"bufferView": sparse_values},
        });
        let mut identity = [0f32; 32];
        [0, 5, 10, 15].iter().for_each(|at| (identity[*at], identity[16 + *at]) = (1.0, 1.0));
        let bind = model.floats("MAT4", 16, &identity);
        let picture = model.view(&pngs()[2]);
        model.push("images", json!({"bufferView": picture, "mimeType": "image/png"}));
        model.push("images", json!({"uri": "good.jpg"}));
        let text = base64::engine::general_purpose::STANDARD.encode(&pngs()[6]);
        model.push("images", json!({"uri": format!("data:image/png;base64,{text}")}));
        model.push("samplers", json!({"wrapS": 33071, "wrapT": 33648, "magFilter": 9728, "minFilter": 9987}));
        (0..3).for_each(|source| {
            model.push("textures", json!({"source": source, "sampler": 0}));
        });
        let placed =
            json!({"KHR_texture_transform": {"offset": [0.1, 0.2], "rotation": 0.5, "scale": [2, 3], "texCoord": 0}});
        model.push("materials", json!({
            "name": "mapped", "doubleSided": true, "alphaMode": "MASK", "alphaCutoff": 0.4,
            "pbrMetallicRoughness": {
                "baseColorFactor": [0.9, 0.8, 1, 0.9], "baseColorTexture": {"index": 0, "extensions": placed},
                "roughnessFactor": 0.8, "metallicFactor": 1, "metallicRoughnessTexture": {"index": 1, "texCoord": 1},
            },
            "normalTexture": {"index": 0, "scale": 0.5}, "occlusionTexture": {"index": 2, "strength": 0.7},
            "emissiveTexture": {"index": 2}, "emissiveFactor": [0.1, 0.2, 0.3],
            "extensions": {
                "KHR_materials_emissive_strength": {"emissiveStrength": 3}, "KHR_materials_ior": {"ior": 1.5},
                "KHR_materials_diffuse_transmission": {"diffuseTransmissionFactor": 0.5,
                    "diffuseTransmissionColorTexture": {"index": 1}, "diffuseTransmissionTexture": {"index": 1}},
            },
        }));
        model.push(
            "materials",
            json!({
                "alphaMode": "BLEND", "pbrMetallicRoughness": {"baseColorFactor": [0.1, 0.3, 0.9, 0.25]},
                "extensions": {"KHR_materials_unlit": {}},
            }),
        );
        let texture = json!({"index": 1});
        model.push(
            "materials",
            json!({"pbrMetallicRoughness": {"metallicFactor": 0, "metallicRoughnessTexture": texture}, "extensions": {
                "KHR_materials_anisotropy": {"anisotropyStrength": 0.5, "anisotropyTexture": texture},
                "KHR_materials_clearcoat": {"clearcoatFactor": 0.5, "clearcoatRoughnessTexture": texture},
                "KHR_materials_iridescence": {"iridescenceFactor": 1, "iridescenceThicknessTexture": texture},
                "KHR_materials_sheen": {"sheenColorFactor": [0.5, 1, 0], "sheenColorTexture": texture},
                "KHR_materials_specular": {"specularFactor": 0.5, "specularColorTexture": texture},
                "KHR_materials_transmission": {"transmissionFactor": 0.5, "transmissionTexture": texture},
                "KHR_materials_volume": {"thicknessFactor": 0.1, "attenuationDistance": 2, "attenuationColor": [1, 0.5, 0]},
            }}),
        );
        let attributes = json!({
            "POSITION": position, "NORMAL": normal, "TANGENT": tangent, "TEXCOORD_0": uv, "TEXCOORD_1": uv1, "COLOR_0": colour,
            "JOINTS_0": joints, "WEIGHTS_0": weights,
        });
        let packed = model.packed_positions();
        model.push("meshes", json!({"weights": [0.5], "primitives": [
            {"attributes": attributes, "indices": indices, "material": 0, "targets": [{"POSITION": moved, "NORMAL": moved}]},
        ]}));
        model.push(
            "meshes",
            json!({"primitives": [
                {"attributes": {"POSITION": position, "TEXCOORD_0": uv}, "mode": 5, "material": 1},
                {"attributes": {"POSITION": position, "TEXCOORD_0": uv}, "mode": 6, "material": 2},
                {"attributes": {"POSITION": packed}},
            ]}),
        );
        model.push("nodes", json!({"mesh": 0, "skin": 0, "children": [1], "weights": [0.25]}));
        model.push(
            "nodes",
            json!({"mesh": 1, "rotation": [0.5, 0.5, 0.5, 0.5], "scale": [-1, 1, 2], "translation": [1, 2, 3]}),
        );
        model.push(
            "nodes",
            json!({"mesh": 1, "matrix": [1, 0, 0, 0, 0.2, 1, 0, 0, 0, 0, 1, 0, -0.5, 0.5, 0.5, 1],
                "extensions": {"KHR_node_visibility": {"visible": true}}}),
        );
        let lights = ["point", "spot", "directional"].iter().map(|kind| {
            json!({"type": kind, "intensity": 20, "color": [1, 0.9, 0.8], "spot": {"innerConeAngle": 0.1, "outerConeAngle": 0.5}})
        });
        let lights: Vec<Value> = lights.collect();
        model.json["extensions"] = json!({"KHR_lights_punctual": {"lights": lights}});
        (0..2).for_each(|light| {
            model.push(
                "nodes",
                json!({"extensions": {"KHR_lights_punctual": {"light": light}}, "translation": [0, 1, 2]}),
            );
        });
        model.push(
            "nodes",
            json!({"camera": 0, "extensions": {"KHR_lights_punctual": {"light": 2}}, "rotation": [0.6, 0, 0, 0.8]}),
        );
        model.json["cameras"] = json!([{"type": "perspective", "perspective": {"yfov": 0.6, "znear": 0.01}}]);
        model.json["skins"] = json!([{"joints": [1, 2], "inverseBindMatrices": bind}]);
        model.json["extensionsUsed"] = json!([
            "KHR_lights_punctual",
            "KHR_texture_transform",
            "KHR_materials_emissive_strength",
            "KHR_materials_ior",
            "KHR_materials_unlit",
            "KHR_materials_iridescence",
            "KHR_materials_transmission",
            "KHR_node_visibility",
            "EXT_meshopt_compression",
        ]);
        model
    }

    /// A triangle in a compressed view.
    fn packed_positions(&mut self) -> usize {
        let packed = ::meshopt::encode_vertex_buffer(&[[0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]).unwrap();
        let view = self.view(&packed);
        let place = self.json["bufferViews"][view].clone();
        self.json["bufferViews"][view] = json!({"buffer": 1, "byteLength": 36, "extensions": {"EXT_meshopt_compression": {
            "buffer": 0, "byteOffset": place["byteOffset"], "byteLength": place["byteLength"], "byteStride": 12, "count": 3,
            "mode": "ATTRIBUTES",
        }}});
        self.push("accessors", json!({"bufferView": view, "componentType": 5126, "count": 3, "type": "VEC3"}))
    }

    fn text(&self) -> Vec<u8> {
        let text = base64::engine::general_purpose::STANDARD.encode(&self.bytes);
        let mut json = self.json.clone();
        let fallback = json!({"byteLength": 36, "extensions": {"EXT_meshopt_compression": {"fallback": true}}});
        json["buffers"] = json!([
            {"byteLength": self.bytes.len(), "uri": format!("data:application/octet-stream;base64,{text}")}, fallback,
        ]);
        json.to_string().into_bytes()
    }

    fn binary(&self) -> Vec<u8> {
        let mut json = self.json.clone();
        let fallback = json!({"byteLength": 36, "extensions": {"EXT_meshopt_compression": {"fallback": true}}});
        json["buffers"] = json!([{"byteLength": self.bytes.len()}, fallback]);
        container(json.to_string().as_bytes(), Some(&self.bytes))
    }
}

pub fn gltf() -> Vec<u8> {
    Model::of_everything().text()
}

pub fn glb() -> Vec<u8> {
    Model::of_everything().binary()
}

pub fn scene() -> Vec<u8> {
    SCENE.into()
}

/// A whole file of each kind, for those that name files.
pub fn write_good_files(folder: &Path) {
    let files: [(&str, Vec<u8>); 8] = [
        ("good.obj", OBJ.into()),
        ("good.mtl", MTL.into()),
        ("good.png", pngs().swap_remove(6)),
        ("good.jpg", jpegs().swap_remove(0)),
        ("good.tga", tgas().swap_remove(1)),
        ("good.hdr", hdrs().swap_remove(0)),
        ("good.exr", exrs().swap_remove(3)),
        ("good.glb", glb()),
    ];
    for (name, bytes) in files {
        std::fs::write(folder.join(name), bytes).unwrap();
    }
}

/// The saved states of the program: its panel, a sequence's record, a ladder, a headset runtime's registry.
pub fn states() -> Vec<Vec<u8>> {
    let panel = json!({"shown": false, "sections": {"Light": true, "Material": false}});
    let record = json!({"program": "0.1.0", "key": "k", "settings": "s", "pictures": {"0001.png": "00ff"}});
    let registry = json!({"version": 1, "jsonid": "vrpathreg", "runtime": ["/a", "/b"], "config": ["/c"]});
    let ladder = crate::measure::ladder::tests::ladder(&[("", 10.0, 0.01), ("--samples 1 --light baked", 4.0, 0.03)]);
    let ladder = serde_json::to_value(ladder).unwrap();
    [panel, record, registry, ladder].iter().map(|state| state.to_string().into_bytes()).collect()
}
