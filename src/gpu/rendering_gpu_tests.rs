//! Rendering to attachments, depth, subresources, comparisons and cube arrays, each on the GPU under validation.

use std::sync::Arc;

use super::*;

const SIZE: [u32; 2] = [8, 4];
const TEXELS: usize = 32;

/// An image of `SIZE` with everything that these tests do to one.
fn image(gpu: &Arc<Gpu>, format: Format, shape: Shape, mips: u32) -> Arc<Image> {
    let attachment = if format == DEPTH_FORMAT {
        ImageUsageFlags::DEPTH_STENCIL_ATTACHMENT
    } else {
        ImageUsageFlags::COLOR_ATTACHMENT
    };
    let copies = ImageUsageFlags::TRANSFER_SRC | ImageUsageFlags::TRANSFER_DST;
    let flat = ImageDesc::flat(format, SIZE, attachment | copies | ImageUsageFlags::SAMPLED);
    Image::new(gpu, "test", ImageDesc { shape, mips, ..flat }).unwrap()
}

fn floats(gpu: &Arc<Gpu>, image: &Image, layer: u32) -> Vec<f32> {
    let bytes = if image.desc().format == DEPTH_FORMAT { 4 } else { 16 };
    bytemuck::pod_collect_to_vec(&read_image(gpu, image, Subresource { mip: 0, layer }, bytes).unwrap())
}

/// A pipeline that fills its targets at a depth.
fn fill(gpu: &Arc<Gpu>, colours: &[Format], depth: Option<DepthState>) -> Pipeline {
    let fragment = (!colours.is_empty()).then_some("test_fill.frag");
    let desc = GraphicsDesc { name: "fill", vertex: "test_fill.vert", push_bytes: 12, ..Default::default() };
    Pipeline::graphics(gpu, &GraphicsDesc { fragment, colours, depth, ..desc }).unwrap()
}

fn draw(commands: &mut Commands<'_>, pipeline: &Pipeline, [depth, slope, step]: [f32; 3], layers: u32) {
    commands.bind(pipeline, &[]);
    commands.push(pipeline, bytemuck::bytes_of(&[depth, slope, step]));
    commands.draw(3, layers);
}

#[test]
fn depth_alone_is_drawn_sampled_and_compared() {
    with_gpu(|gpu| {
        let depth = image(gpu, DEPTH_FORMAT, Shape::Layers(2), 1);
        let pipeline = fill(gpu, &[], Some(DepthState::WRITE));
        let plain = Sampler::nearest(gpu, "plain", AddressMode::WhiteBorder).unwrap();
        let shadow = Sampler::compare(gpu, "shadow", AddressMode::BlackBorder, Compare::GreaterOrEqual).unwrap();
        // Points inside the layers at depths 0.25 and 0.75, then outside: u, v, layer, reference.
        let points: [[f32; 4]; 5] = [
            [0.5, 0.5, 0.0, 0.3],
            [0.5, 0.5, 0.0, 0.2],
            [0.5, 0.5, 1.0, 0.3],
            [0.5, 0.5, 1.0, 0.8],
            [2.0, 0.5, 1.0, 0.1],
        ];
        let from = Buffer::with_bytes(gpu, "points", BufferKind::FromCpu, bytemuck::bytes_of(&points)).unwrap();
        let to = Buffer::new(gpu, "results", BufferKind::Storage, 8 * points.len() as u64).unwrap();
        let kinds = [BindingType::Sampled, BindingType::Sampled, BindingType::Storage, BindingType::Storage];
        let layout = DescriptorSetLayout::new(gpu, "sampled depth", &kinds).unwrap();
        let bindings = [
            Binding::Sampled(&depth, &plain),
            Binding::Sampled(&depth, &shadow),
            Binding::Storage(&from),
            Binding::Storage(&to),
        ];
        let set = DescriptorSet::new(gpu, "sampled depth", &layout, &bindings).unwrap();
        let sample = Pipeline::compute(gpu, "test_sampled_depth.comp", &[], &[&layout], 0).unwrap();
        submit_and_wait(gpu, |commands| {
            commands.prepare_fresh(&depth, ImageAccess::Depth);
            let attachment = DepthAttachment::cleared(depth.attachment(), 0.0);
            commands.render(&Attachments { colours: &[], depth: Some(attachment), area: SIZE }, |commands| {
                draw(commands, &pipeline, [0.25, 0.0, 0.5], 2);
            });
            commands.prepare(&depth, ImageAccess::DepthSampled);
            commands.bind(&sample, &[&set]);
            commands.dispatch([1, 1, 1]);
            Ok(())
        })
        .unwrap();
        let results: Vec<[f32; 2]> = bytemuck::pod_collect_to_vec(&read_buffer(gpu, &to).unwrap());
        assert_eq!(results, [[0.25, 1.0], [0.25, 0.0], [0.75, 0.0], [0.75, 1.0], [1.0, 1.0]]);
        assert_eq!(floats(gpu, &depth, 1), [0.75; TEXELS]);
    });
}

/// What is left in a colour image after a draw at `depth` with `state`, over depth 0.5 that another pass has stored.
fn drawn_over_half(gpu: &Arc<Gpu>, depth: f32, slope: f32, state: DepthState) -> usize {
    let format = Format::R32G32B32A32_SFLOAT;
    let (colour, second) = (image(gpu, format, Shape::Flat, 1), image(gpu, format, Shape::Flat, 1));
    let depths = image(gpu, DEPTH_FORMAT, Shape::Flat, 1);
    let (before, over) = (fill(gpu, &[], Some(DepthState::WRITE)), fill(gpu, &[format; 2], Some(state)));
    submit_and_wait(gpu, |commands| {
        [&colour, &second].iter().for_each(|image| commands.prepare_fresh(image, ImageAccess::Colour));
        commands.prepare_fresh(&depths, ImageAccess::Depth);
        let attachment = DepthAttachment::cleared(depths.attachment(), 0.0);
        commands.render(&Attachments { colours: &[], depth: Some(attachment), area: SIZE }, |commands| {
            draw(commands, &before, [0.5, 0.0, 0.0], 1);
        });
        commands.prepare(&depths, ImageAccess::Depth);
        let colours = [&colour, &second].map(|image| ColourAttachment::cleared(image.attachment(), [0.0; 4]));
        let attachment = DepthAttachment { load: LoadOp::Load, store: StoreOp::Store, ..attachment };
        commands.render(&Attachments { colours: &colours, depth: Some(attachment), area: SIZE }, |commands| {
            draw(commands, &over, [depth, slope, 0.0], 1);
        });
        Ok(())
    })
    .unwrap();
    let stored = floats(gpu, &depths, 0);
    assert!(state.write || stored == [0.5; TEXELS], "{stored:?}");
    floats(gpu, &colour, 0).chunks_exact(4).filter(|texel| **texel == [1.0, 2.0, 3.0, 4.0]).count()
}

#[test]
fn loaded_depth_is_tested_with_the_chosen_comparison_and_bias() {
    with_gpu(|gpu| {
        let count = |depth, state| drawn_over_half(gpu, depth, 0.0, state);
        assert_eq!((count(0.6, DepthState::WRITE), count(0.4, DepthState::WRITE)), (TEXELS, 0));
        assert_eq!((count(0.5, DepthState::TEST), count(0.4, DepthState::TEST)), (TEXELS, 0));
        let less = DepthState { compare: Compare::Less, ..DepthState::WRITE };
        assert_eq!((count(0.6, less), count(0.5, less), count(0.4, less)), (0, 0, TEXELS));
        assert_eq!(count(0.1, DepthState { compare: Compare::Always, ..less }), TEXELS);
        let greater = DepthState { compare: Compare::Greater, ..DepthState::TEST };
        let biased = |constant, slope| DepthState { bias: Some(DepthBias { constant, slope }), ..greater };
        assert_eq!((count(0.5, greater), count(0.5, biased(4.0, 0.0))), (0, TEXELS));
        // From 0.3 to 0.5 over the picture's width: only the slope's share lifts it above 0.5.
        let sloped = |state| drawn_over_half(gpu, 0.4, 0.1, state);
        assert_eq!((sloped(greater), sloped(biased(0.0, 16.0))), (0, TEXELS));
    });
}

#[test]
fn several_colours_keep_or_lose_their_content_apart() {
    with_gpu(|gpu| {
        let formats = [Format::R32G32B32A32_SFLOAT, Format::R8G8B8A8_UNORM];
        let [first, second] = formats.map(|format| image(gpu, format, Shape::Flat, 1));
        let pipeline = fill(gpu, &formats, None);
        submit_and_wait(gpu, |commands| {
            [&first, &second].iter().for_each(|image| commands.prepare_fresh(image, ImageAccess::Colour));
            let colours = [
                ColourAttachment::cleared(first.attachment(), [9.0; 4]),
                ColourAttachment::cleared(second.attachment(), [1.0, 0.0, 0.0, 1.0]),
            ];
            commands.render(&Attachments { colours: &colours, depth: None, area: SIZE }, |_| ());
            [&first, &second].iter().for_each(|image| commands.prepare(image, ImageAccess::Colour));
            // The left half is drawn; the second image's clear reaches no farther either.
            let colours = [ColourAttachment::loaded(first.attachment()), colours[1]];
            let area = [SIZE[0] / 2, SIZE[1]];
            commands.render(&Attachments { colours: &colours, depth: None, area }, |commands| {
                draw(commands, &pipeline, [0.5, 0.0, 0.0], 1);
            });
            Ok(())
        })
        .unwrap();
        let texels = floats(gpu, &first, 0);
        assert_eq!((&texels[..4], &texels[4 * 4..4 * 5]), (&[1.0, 2.0, 3.0, 4.0][..], &[9.0; 4][..]));
        let bytes = read_image(gpu, &second, Subresource { mip: 0, layer: 0 }, 4).unwrap();
        assert_eq!((&bytes[..4], &bytes[4 * 4..4 * 5]), (&[64, 128, 191, 255][..], &[255, 0, 0, 255][..]));
    });
}

#[test]
fn one_layer_of_one_mip_is_drawn_while_others_keep_their_own_layouts() {
    with_gpu(|gpu| {
        let format = Format::R32G32B32A32_SFLOAT;
        let layered = image(gpu, format, Shape::Layers(3), 2);
        let clear = |commands: &mut Commands<'_>, part: Subresource, value: f32| {
            let (mips, layers) = (part.mip..part.mip + 1, part.layer..part.layer + 1);
            commands.prepare_subresources(&layered, mips, layers, ImageAccess::Colour);
            let colours = [ColourAttachment::cleared(layered.attachment_of(part), [value; 4])];
            let area = layered.mip_size(part.mip);
            commands.render(&Attachments { colours: &colours, depth: None, area }, |_| ());
        };
        let parts: Vec<Subresource> = (0..6).map(|i| Subresource { mip: i / 3, layer: i % 3 }).collect();
        submit_and_wait(gpu, |commands| {
            clear(commands, parts[4], 4.0);
            Ok(())
        })
        .unwrap();
        // Of the others nothing has been written.
        assert!(read_mips(gpu, &layered, 16).unwrap_err().to_string().contains("nothing has been written"));
        submit_and_wait(gpu, |commands| {
            commands.prepare_subresources(&layered, 1..2, 1..2, ImageAccess::Sampled);
            let all = || (0..).zip(&parts);
            all().filter(|(i, _)| *i != 4).for_each(|(i, part)| clear(commands, *part, i as f32));
            // Two accesses, in three runs of layers and one: all of the image comes to the same again.
            commands.prepare(&layered, ImageAccess::Sampled);
            Ok(())
        })
        .unwrap();
        assert!(parts.iter().all(|part| layered.access(part.mip, part.layer) == ImageAccess::Sampled));
        let mips: Vec<Vec<f32>> =
            read_mips(gpu, &layered, 16).unwrap().iter().map(|m| bytemuck::pod_collect_to_vec(m)).collect();
        let want = |mip: u32| -> Vec<f32> {
            let texels = 4 * layered.mip_size(mip).iter().product::<u32>();
            (0..3).flat_map(|layer| vec![(3 * mip + layer) as f32; texels as usize]).collect()
        };
        assert_eq!(mips, [want(0), want(1)]);
    });
}

#[test]
fn arrays_of_cubes_are_sampled_and_vertices_read_as_storage() {
    with_gpu(|gpu| {
        assert!(gpu.has_cube_arrays(), "this GPU cannot run the test");
        let usage = ImageUsageFlags::SAMPLED | ImageUsageFlags::TRANSFER_DST;
        let flat = ImageDesc::flat(Format::R32G32B32A32_SFLOAT, [4, 4], usage);
        let cubes = Image::new(gpu, "cubes", ImageDesc { shape: Shape::CubeArray(2), ..flat }).unwrap();
        let texels: Vec<f32> = (0..12).flat_map(|layer| [layer as f32; 4 * 16]).collect();
        write_mips(gpu, "cubes", &[(&cubes, &[bytemuck::cast_slice(&texels).to_vec()])]).unwrap();
        // +X, −X, +Y, −Y, +Z, −Z of both cubes, kept as vertices.
        let axis =
            |face: usize| std::array::from_fn(|i| if i == face / 2 { 1.0 - 2.0 * (face % 2) as f32 } else { 0.0 });
        let directions: Vec<[f32; 4]> = (0..12usize)
            .map(|layer| {
                let [x, y, z]: [f32; 3] = axis(layer % 6);
                [x, y, z, (layer / 6) as f32]
            })
            .collect();
        let vertices = Buffer::new(gpu, "vertices", BufferKind::Vertex, size_of_val(&directions[..]) as u64).unwrap();
        let mut upload = Upload::new(gpu);
        upload.buffer(&vertices, bytemuck::cast_slice(&directions)).unwrap();
        upload.finish().unwrap();
        let to = Buffer::new(gpu, "results", BufferKind::Storage, vertices.size()).unwrap();
        let kinds = [BindingType::Sampled, BindingType::Storage, BindingType::Storage];
        let layout = DescriptorSetLayout::new(gpu, "cubes", &kinds).unwrap();
        let sampler = Sampler::new(gpu, "cubes", AddressMode::Clamp, 1).unwrap();
        let bindings = [Binding::Sampled(&cubes, &sampler), Binding::Storage(&vertices), Binding::Storage(&to)];
        let set = DescriptorSet::new(gpu, "cubes", &layout, &bindings).unwrap();
        // The set holds what it binds.
        drop((cubes, sampler, vertices));
        let pipeline = Pipeline::compute(gpu, "test_cube_array.comp", &[], &[&layout], 0).unwrap();
        submit_and_wait(gpu, |commands| {
            commands.bind(&pipeline, &[&set]);
            commands.dispatch([1, 1, 1]);
            Ok(())
        })
        .unwrap();
        let results: Vec<[f32; 4]> = bytemuck::pod_collect_to_vec(&read_buffer(gpu, &to).unwrap());
        assert_eq!(results, (0..12).map(|layer| [layer as f32; 4]).collect::<Vec<_>>());
    });
}
