//! What a preview's pages hold: the light that leaves every surface, fine enough for the textures of the surfaces.
//!
//! A lightmap is coarse, as light is smooth; the colour of a surface is not. So a page of radiance may have more texels
//! than the page of light that it is made from.

use super::lookup::{bilinear, mean_over_triangle};
use crate::atlas::{Atlas, Placement};
use crate::resolve::{Lightmap, LightmapPage, push_pull};
use crate::scene::{Scene, SurfacePoint};
use glam::{Vec2, Vec3};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Pages are made finer up to this size, texels.
const MOST_TEXELS: u32 = 2048;
/// Texels whose middle is this near to a triangle belong to it, in fine texels: what bilinear lookups at its border
/// read, and what no middle lies in.
const REACH: f32 = 1.5;
/// Places in a fine texel where a texture is read.
const LOOKS: [Vec2; 4] =
    [Vec2::new(-0.25, -0.25), Vec2::new(0.25, -0.25), Vec2::new(-0.25, 0.25), Vec2::new(0.25, 0.25)];
/// No triangle.
const NOBODY: u32 = u32::MAX;

/// One page of radiance.
#[derive(Debug)]
pub(super) struct RadiancePage {
    /// Width and height.
    pub size_texels: u32,
    /// Row by row from the top: ρE/π + L_e, divided by the `white` of the material that the texel shows.
    pub value: Vec<Vec3>,
    /// The largest radiance of every material of the file (`None`: the default one) on this page; never zero.
    pub white: BTreeMap<Option<usize>, f32>,
}

/// A triangle on a page.
struct Piece {
    surface: u32,
    triangle: u32,
    /// In fine texels, as [`Scene::corner_indices`] orders them.
    corners: [Vec2; 3],
}

/// Paints one page of the atlas; `light` is that page with E/π.
pub(super) fn paint(scene: &Scene, atlas: &Atlas, page: u32, light: &LightmapPage) -> RadiancePage {
    let finer = finer(scene, atlas, page);
    let pieces = pieces(scene, atlas, page, finer as f32);
    let size = light.size_texels * finer;
    let owner = owners(&pieces, size as usize);
    let textured: Vec<bool> = scene
        .surfaces
        .iter()
        .map(|surface| scene.material(surface))
        .map(|material| {
            [&material.base_color_texture, &material.metallic_texture, &material.emission_texture]
                .iter()
                .any(|slot| slot.is_some())
        })
        .collect();

    let mut value: Vec<Vec3> = owner
        .par_iter()
        .enumerate()
        .map(|(texel, &owner)| {
            let Some(piece) = pieces.get(owner as usize) else { return Vec3::ZERO };
            let middle = Vec2::new((texel % size as usize) as f32, (texel / size as usize) as f32) + 0.5;
            let white = bilinear(&light.value, [light.size_texels as usize; 2], middle / finer as f32);
            let seen = |at: Vec2| {
                let (barycentric, _) = nearest(&piece.corners, at);
                let at = SurfacePoint { surface: piece.surface, triangle: piece.triangle, barycentric };
                scene.reflectance(at).0 * white + scene.emission(at).0
            };
            if textured[piece.surface as usize] {
                LOOKS.iter().map(|&off| seen(middle + off)).sum::<Vec3>() / LOOKS.len() as f32
            } else {
                seen(middle)
            }
        })
        .map(|value| if value.is_finite() { value.max(Vec3::ZERO) } else { Vec3::ZERO })
        .collect();

    let material = |piece: &Piece| scene.material(&scene.surfaces[piece.surface as usize]).index;
    let mut white: BTreeMap<Option<usize>, f32> = BTreeMap::new();
    let of_texels = owner.iter().zip(&value).filter_map(|(&o, value)| Some((pieces.get(o as usize)?, value)));
    for (piece, value) in of_texels {
        let most = white.entry(material(piece)).or_insert(0.0);
        *most = most.max(value.max_element());
    }
    white.values_mut().for_each(|most| *most = if *most > 0.0 { *most } else { 1.0 });
    let scale: Vec<f32> =
        pieces.iter().map(|piece| white.get(&material(piece)).map_or(1.0, |w| 1.0 / w)).collect();
    value.par_iter_mut().zip(&owner).for_each(|(value, &owner)| {
        *value *= scale.get(owner as usize).copied().unwrap_or(1.0);
    });
    let known: Vec<bool> = owner.iter().map(|&owner| owner != NOBODY).collect();
    push_pull(&mut value, &known, size as usize);
    RadiancePage { size_texels: size, value, white }
}

/// The mean E/π of all lightmapped surfaces, weighted by area.
pub(super) fn mean_white_radiance(scene: &Scene, atlas: &Atlas, light: &Lightmap) -> Vec3 {
    let (mut sum, mut area) = (glam::DVec3::ZERO, 0.0);
    for (number, page) in (0..).zip(&light.pages) {
        for piece in pieces(scene, atlas, number, 1.0) {
            let surface = &scene.surfaces[piece.surface as usize];
            let [a, b, c] = scene.corners_world(surface, piece.triangle).map(Vec3::as_dvec3);
            let weight = (b - a).cross(c - a).length() / 2.0;
            let mean = mean_over_triangle(&page.value, [page.size_texels as usize; 2], piece.corners);
            if mean.is_finite() && weight.is_finite() {
                sum += mean.as_dvec3() * weight;
                area += weight;
            }
        }
    }
    if area > 0.0 { (sum / area).as_vec3() } else { Vec3::ZERO }
}

fn fronts<'a>(scene: &'a Scene, atlas: &'a Atlas, page: u32) -> impl Iterator<Item = (u32, &'a Placement)> {
    let placed = (0..).zip(&atlas.fronts).filter_map(|(s, front)| Some((s, front.as_ref()?)));
    placed.filter(move |(s, front)| front.page == page && (*s as usize) < scene.surfaces.len())
}

/// How many times finer than the light the page must be, to have as many texels as the finest texture on it has.
fn finer(scene: &Scene, atlas: &Atlas, page: u32) -> u32 {
    let size = atlas.pages[page as usize].size_texels.max(1);
    let mut wanted = 1.0_f64;
    for (s, front) in fronts(scene, atlas, page) {
        let surface = &scene.surfaces[s as usize];
        let material = scene.material(surface);
        let geometry = scene.geometry(surface);
        for slot in [&material.base_color_texture, &material.metallic_texture, &material.emission_texture] {
            let Some(slot) = slot else { continue };
            let Some(uv) = geometry.texcoords.get(slot.texcoord) else { continue };
            let [w, h] = scene.textures[slot.texture.0 as usize].size();
            let at = |i: u32| slot.transform.transform_point2(uv[i as usize]) * Vec2::new(w as f32, h as f32);
            let (mut texels, mut light) = (0.0_f64, 0.0_f64);
            for (corners, placed) in geometry.triangles.iter().zip(&front.unwrap.triangles) {
                texels += twice_area(corners.map(at));
                light += twice_area(placed.map(|i| front.uv_texels[i as usize]));
            }
            let ratio = (texels / light).sqrt();
            if ratio.is_finite() {
                wanted = wanted.max(ratio);
            }
        }
    }
    let most = (MOST_TEXELS / size).max(1);
    (wanted.min(f64::from(most)).ceil() as u32).next_power_of_two().min(most)
}

fn twice_area([a, b, c]: [Vec2; 3]) -> f64 {
    f64::from((b - a).perp_dot(c - a).abs())
}

fn pieces(scene: &Scene, atlas: &Atlas, page: u32, scale: f32) -> Vec<Piece> {
    let mut pieces = Vec::new();
    for (s, front) in fronts(scene, atlas, page) {
        let mirrored = scene.surfaces[s as usize].mirrored;
        for (t, &[a, b, c]) in (0..).zip(&front.unwrap.triangles) {
            let corners = if mirrored { [a, c, b] } else { [a, b, c] };
            let corners = corners.map(|i| front.uv_texels[i as usize] * scale);
            if twice_area(corners) > 0.0 {
                pieces.push(Piece { surface: s, triangle: t, corners });
            }
        }
    }
    pieces
}

/// The nearest piece of every texel, if one is within [`REACH`]; of several that hold its middle, the first.
fn owners(pieces: &[Piece], size: usize) -> Vec<u32> {
    let mut owner = vec![NOBODY; size * size];
    let mut best = vec![REACH * REACH; size * size];
    for (number, piece) in (0..).zip(pieces) {
        let [a, b, c] = piece.corners;
        let last = size as f32 - 1.0;
        let low = (a.min(b).min(c) - REACH - 0.5).ceil().clamp(Vec2::ZERO, Vec2::splat(last));
        let high = (a.max(b).max(c) + REACH - 0.5).floor().clamp(Vec2::ZERO, Vec2::splat(last));
        for y in low.y as usize..=high.y as usize {
            for x in low.x as usize..=high.x as usize {
                let (_, far) = nearest(&piece.corners, Vec2::new(x as f32 + 0.5, y as f32 + 0.5));
                let texel = y * size + x;
                if far < best[texel] {
                    best[texel] = far;
                    owner[texel] = number;
                }
            }
        }
    }
    owner
}

/// The point of a triangle nearest to `at`: weights of its second and third corner, and the distance squared.
fn nearest(&[a, b, c]: &[Vec2; 3], at: Vec2) -> (Vec2, f32) {
    let (u, v, p) = (b - a, c - a, at - a);
    let area = u.perp_dot(v);
    let w = Vec2::new(p.perp_dot(v), u.perp_dot(p)) / area;
    if w.x >= 0.0 && w.y >= 0.0 && w.x + w.y <= 1.0 {
        return (w, 0.0);
    }
    let along = |from: Vec2, side: Vec2| {
        let t = ((at - from).dot(side) / side.length_squared().max(f32::MIN_POSITIVE)).clamp(0.0, 1.0);
        (t, at.distance_squared(from + side * t))
    };
    let ((t, ab), (s, ac), (r, bc)) = (along(a, u), along(a, v), along(b, c - b));
    if ab <= ac && ab <= bc {
        (Vec2::new(t, 0.0), ab)
    } else if ac <= bc {
        (Vec2::new(0.0, s), ac)
    } else {
        (Vec2::new(1.0 - r, r), bc)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::atlas::{Page, Unwrap};
    use crate::scene::{
        Filter, Geometry, GeometryId, Material, MaterialId, Origin, Pixels, Role, Surface, Texture,
        TextureId, TextureSlot, Wrap,
    };
    use crate::units::Radiance;
    use std::sync::Arc;

    #[test]
    fn the_nearest_point_of_a_triangle() {
        let corners = [Vec2::new(1.0, 1.0), Vec2::new(5.0, 1.0), Vec2::new(1.0, 5.0)];
        let point = |w: Vec2| corners[0] + (corners[1] - corners[0]) * w.x + (corners[2] - corners[0]) * w.y;
        for (at, on) in [
            ((2.0, 2.0), (2.0, 2.0)),
            ((3.0, 0.0), (3.0, 1.0)),
            ((0.0, 2.5), (1.0, 2.5)),
            ((4.0, 4.0), (3.0, 3.0)),
            ((9.0, 1.0), (5.0, 1.0)),
            ((0.0, 0.0), (1.0, 1.0)),
        ] {
            let (at, on) = (Vec2::from(at), Vec2::from(on));
            let (w, far) = nearest(&corners, at);
            assert!(
                point(w).distance(on) < 1e-6 && (far - at.distance_squared(on)).abs() < 1e-5,
                "{at}: {w} {far}"
            );
        }
    }

    /// A square with a texture of 64 stripes on a page of 16 texels.
    fn stripes() -> (Scene, Atlas) {
        let bytes = (0..64 * 64).map(|i| if i % 2 == 0 { [255; 4] } else { [0, 0, 0, 255] }).collect();
        let wrap = [Wrap::Clamp; 2];
        let texture = Texture::new("stripes".into(), [64; 2], Pixels::Linear8(bytes), wrap, Filter::Nearest);
        let corners = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)].map(Vec2::from);
        let triangles = vec![[0, 1, 2], [0, 2, 3]];
        let slot = TextureSlot { texture: TextureId(0), texcoord: 0, transform: glam::Affine2::IDENTITY };
        let material = Material {
            index: Some(3),
            base_color: glam::Vec4::new(0.5, 0.5, 0.5, 1.0),
            base_color_texture: Some(slot),
            emission: Radiance(Vec3::new(2.0, 0.0, 0.0)),
            ..Material::default()
        };
        let position: Vec<Vec3> = corners.iter().map(|c| Vec3::new(c.x, 0.0, c.y)).collect();
        let scene = Scene {
            textures: vec![texture.unwrap()],
            materials: vec![material],
            geometries: vec![Geometry {
                position_local: position.clone(),
                texcoords: vec![corners.to_vec()],
                triangles: triangles.clone(),
                ..Geometry::default()
            }],
            surfaces: vec![Surface {
                origin: Origin::default(),
                geometry: GeometryId(0),
                material: MaterialId(0),
                world_from_local: glam::DAffine3::IDENTITY,
                position_world: position,
                normal_world: vec![Vec3::Y; 4],
                mirrored: false,
                role: Role::Lightmapped,
                density_factor: 1.0,
            }],
            ..Scene::default()
        };
        let unwrap = Unwrap {
            source_vertex: vec![0, 1, 2, 3],
            triangles,
            chart_of_triangle: vec![0, 0],
            chart_count: 1,
        };
        let front = Placement {
            page: 0,
            unwrap: Arc::new(unwrap),
            // Eight light texels: eight texels of the texture on each.
            uv_texels: corners.iter().map(|&c| c * 8.0 + 4.0).collect(),
            rect_texels: [Vec2::splat(3.0), Vec2::splat(13.0)],
        };
        let pages = vec![Page { size_texels: 16, exported: true }];
        (scene, Atlas { pages, fronts: vec![Some(front)], backs: vec![None], ..Atlas::default() })
    }

    #[test]
    fn pages_are_as_fine_as_the_textures() {
        let (scene, atlas) = stripes();
        let light =
            LightmapPage { size_texels: 16, value: vec![Vec3::splat(4.0); 256], covered: vec![true; 256] };
        let page = paint(&scene, &atlas, 0, &light);
        assert_eq!((page.size_texels, page.white[&Some(3)]), (128, 4.0), "0.5 × 4 + 2 is the most");
        let at = |x: usize| page.value[64 * 128 + x] * 4.0;
        for x in 32..96 {
            let lit = if x % 2 == 0 { 2.0 } else { 0.0 };
            assert!((at(x) - Vec3::new(2.0 + lit, lit, lit)).abs().max_element() < 1e-5, "{x}: {}", at(x));
        }
        // What bilinear lookups at the border read; then means, never black.
        assert_eq!((at(31), at(96)), (at(32), at(95)));
        assert!(page.value.iter().all(|value| value.x >= 0.5));
        let mean = mean_white_radiance(&scene, &atlas, &Lightmap { pages: vec![light] });
        assert!((mean - 4.0).abs().max_element() < 1e-5);
    }

    #[test]
    fn texels_belong_to_what_covers_them_and_the_border_around_it() {
        let piece = |x: f32| Piece {
            surface: 0,
            triangle: 0,
            corners: [Vec2::new(x, 4.5), Vec2::new(x + 4.0, 4.5), Vec2::new(x, 8.5)],
        };
        let owner = owners(&[piece(4.5), piece(10.5)], 16);
        let at = |x: usize, y: usize| owner[y * 16 + x];
        // The one between the two is as near to both.
        assert_eq!([at(4, 4), at(5, 5), at(8, 4), at(3, 4), at(10, 4), at(9, 4)], [0, 0, 0, 0, 1, 0]);
        assert_eq!([at(2, 4), at(12, 9), at(0, 0), at(15, 15)], [NOBODY; 4]);
    }
}
