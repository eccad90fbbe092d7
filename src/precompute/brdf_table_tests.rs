//! The GPU's BRDF table against the quadrature in f64.

use glam::DVec2;

use super::*;
use crate::gpu::Part;
use crate::precompute::harness_tests::{texels, with_gpu};
use crate::reference::table::table_entry;

fn table(geometry: Geometry) -> Vec<DVec2> {
    let found = with_gpu(|gpu| {
        let table = BrdfTable::new(gpu, geometry).unwrap();
        texels(gpu, &table.image, Part { mip: 0, layer: 0 })
    });
    found.iter().map(|t| t.truncate()).collect()
}

fn truth(nv: f64, roughness: f64, geometry: Geometry) -> DVec2 {
    let entry = table_entry(nv, roughness, geometry);
    DVec2::new(entry.scale, entry.bias)
}

#[test]
fn texels_hold_the_integral() {
    let centre = |i: u32| (f64::from(i) + 0.5) / f64::from(SIZE);
    for geometry in [Geometry::Smith, Geometry::Karis2013] {
        let table = table(geometry);
        // Every ninth row and column, and the outermost ones, where the integrand is hardest.
        let some: Vec<u32> = (0..SIZE).filter(|i| i % 9 == 4 || [0, 1, 2, SIZE - 1].contains(i)).collect();
        let mut worst = (0.0, DVec2::ZERO);
        for (x, y) in some.iter().flat_map(|y| some.iter().map(move |x| (*x, *y))) {
            let (nv, roughness) = (centre(x), centre(y));
            let error = (table[(y * SIZE + x) as usize] - truth(nv, roughness, geometry)).abs().max_element();
            if error > worst.0 {
                worst = (error, DVec2::new(nv, roughness));
            }
        }
        println!("{geometry:?}: at worst {:.2e} at n·v and roughness {}", worst.0, worst.1);
        assert!(worst.0 <= 2e-3, "{geometry:?}: {} at n·v and roughness {}", worst.0, worst.1);
        let sums = table.iter().map(|t| t.x + t.y);
        assert!(table.iter().all(|t| t.min_element() >= 0.0) && sums.fold(0.0, f64::max) <= 1.001);
    }
}

/// failures.md: the spot values of the thesis that lie between texel centres, filtered as a sampler does.
#[test]
fn lookups_meet_the_spot_values() {
    let table = table(Geometry::Karis2013);
    let lookup = |nv: f64, roughness: f64| {
        let at = DVec2::new(nv, roughness) * f64::from(SIZE) - 0.5;
        let (base, part) = (at.floor(), at - at.floor());
        let texel = |dx: u32, dy: u32| table[((base.y as u32 + dy) * SIZE + base.x as u32 + dx) as usize];
        texel(0, 0).lerp(texel(1, 0), part.x).lerp(texel(0, 1).lerp(texel(1, 1), part.x), part.y)
    };
    // Between the first two columns a smooth surface's entries bend sharply: there it is the filter that is off.
    for (nv, roughness, scale, bias, bound) in [
        (0.01, 0.1, 0.092704, 0.536113, 1e-2),
        (0.01, 0.01, 0.048560, 0.941608, 5e-3),
        (0.1, 0.5, 0.590177, 0.098367, 2e-3),
        (0.5, 0.5, 0.728534, 0.018546, 2e-3),
    ] {
        let error = (lookup(nv, roughness) - DVec2::new(scale, bias)).abs().max_element();
        println!("({nv}, {roughness}): off by {error:.2e}");
        assert!(error <= bound, "({nv}, {roughness}): off by {error}");
    }
}
