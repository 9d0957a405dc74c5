//! Lightmaps of different densities, compared at points of the surfaces.

use crate::bake::Lit;
use crate::elements::Lookup;
use crate::options::Store;
use crate::resolve::{self, Lightmap};
use crate::scene::Scene;
use crate::transport::{Hit, World};
use glam::{Vec2, Vec3};

/// What a viewer finds in the lightmap `coarse`, by bilinear lookup, at the texel centres `at` (elements) of `fine`.
/// `None` where the lightmap has nothing.
pub fn looked_up(scene: &Scene, coarse: &Lit, fine: &Lit, at: &[u32]) -> Vec<Option<Vec3>> {
    let world = World::new(scene);
    let light: Vec<_> = (0..coarse.elements.len()).map(|e| coarse.irradiance(e)).collect();
    let lightmap = resolve::resolve(scene, &coarse.elements, &coarse.atlas, &light, Store::Irradiance);
    let mut number = 0;
    let exported = coarse.atlas.pages.iter().map(|page| {
        number += usize::from(page.exported);
        page.exported.then(|| number - 1)
    });
    let exported: Vec<Option<usize>> = exported.collect();
    let lookup = Lookup::new(scene, &coarse.atlas, &world, &coarse.elements);
    let find = |&e: &u32| {
        let hit = under(fine, &world, e as usize);
        let (page, place) = lookup.texel_at(&hit)?;
        let page = exported.get(page as usize).copied().flatten()?;
        Some(bilinear(&lightmap, page, place))
    };
    at.iter().map(find).collect()
}

/// The point of the world's surface that is nearest to an element's sample in the plane of its triangle.
fn under(lit: &Lit, world: &World, e: usize) -> Hit {
    let triangle = lit.elements.triangle[e];
    let [a, b, c] = world.corners(triangle).map(|corner| corner.as_dvec3());
    let (u, v, p) = (b - a, c - a, lit.elements.position_world[e].as_dvec3() - a);
    let normal = u.cross(v);
    let scale = normal.length_squared();
    let along = |x: f64| if x.is_finite() { x.clamp(0.0, 1.0) } else { 0.0 };
    let first = along(p.cross(v).dot(normal) / scale);
    let second = along(u.cross(p).dot(normal) / scale).min(1.0 - first);
    let chart = &lit.elements.charts[lit.elements.chart[e] as usize];
    Hit { t: 0.0, triangle, u: first as f32, v: second as f32, front: !chart.back }
}

/// Value at a point of a page, texels, as texture units find it.
fn bilinear(lightmap: &Lightmap, page: usize, place: Vec2) -> Vec3 {
    let page = &lightmap.pages[page];
    let limit = page.size_texels as i32 - 1;
    let corner = (place - 0.5).floor();
    let f = place - 0.5 - corner;
    let at = |dx: i32, dy: i32| {
        let (x, y) = ((corner.x as i32 + dx).clamp(0, limit), (corner.y as i32 + dy).clamp(0, limit));
        page.value[y as usize * page.size_texels as usize + x as usize]
    };
    at(0, 0).lerp(at(1, 0), f.x).lerp(at(0, 1).lerp(at(1, 1), f.x), f.y)
}
