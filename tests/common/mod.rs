//! Scenes built in code, and the light that lightkiln finds in them.
#![allow(dead_code)]

use glam::{DAffine3, DVec3, Vec3, Vec4};
use lightkiln::bake::{self, Lit, Run};
use lightkiln::options::{BakeOptions, Quality};
use lightkiln::scene::{
    Geometry, GeometryId, Lamp, LampKind, Material, MaterialId, Origin, Role, Scene, Sky, Surface,
};
use lightkiln::units::{Intensity, Irradiance, Radiance};
use std::path::{Path, PathBuf};

/// Collects surfaces into a scene.
#[derive(Default)]
pub struct Builder {
    pub scene: Scene,
}

impl Builder {
    pub fn new() -> Self {
        Self { scene: Scene { materials: vec![Material::default()], ..Scene::default() } }
    }

    pub fn material(&mut self, reflectance: f32, emitted_radiance: f32) -> MaterialId {
        self.scene.materials.push(Material {
            name: format!("rho {reflectance}"),
            base_color: Vec4::new(reflectance, reflectance, reflectance, 1.0),
            emission: Radiance::grey(emitted_radiance),
            ..Material::default()
        });
        MaterialId(self.scene.materials.len() as u32 - 1)
    }

    /// A parallelogram seen counter-clockwise from its front.
    pub fn quad(&mut self, corner: Vec3, u: Vec3, v: Vec3, material: MaterialId) -> usize {
        let position = vec![corner, corner + u, corner + u + v, corner + v];
        self.mesh(position, vec![[0, 1, 2], [0, 2, 3]], material)
    }

    /// A flat-shaded mesh in world space.
    pub fn mesh(&mut self, position: Vec<Vec3>, triangles: Vec<[u32; 3]>, material: MaterialId) -> usize {
        let mut normal = vec![Vec3::ZERO; position.len()];
        for t in &triangles {
            let [a, b, c] = t.map(|i| position[i as usize]);
            for &i in t {
                normal[i as usize] += (b - a).cross(c - a);
            }
        }
        for n in &mut normal {
            *n = n.normalize_or(Vec3::Y);
        }
        let index = self.scene.surfaces.len();
        self.scene.geometries.push(Geometry {
            name: format!("mesh {index}"),
            position_local: position.clone(),
            normal_local: normal.clone(),
            triangles,
            ..Geometry::default()
        });
        self.scene.surfaces.push(Surface {
            origin: Origin { name: format!("object {index}"), node: index, mesh: index, ..Origin::default() },
            geometry: GeometryId(self.scene.geometries.len() as u32 - 1),
            material,
            world_from_local: DAffine3::IDENTITY,
            position_world: position,
            normal_world: normal,
            mirrored: false,
            role: Role::Lightmapped,
            density_factor: 1.0,
        });
        index
    }

    /// The six walls of a box, facing inwards; returns the surface of `-x, +x, -y, +y, -z, +z`.
    pub fn room(&mut self, min: Vec3, max: Vec3, materials: [MaterialId; 6]) -> [usize; 6] {
        let d = max - min;
        let (x, y, z) = (Vec3::X * d.x, Vec3::Y * d.y, Vec3::Z * d.z);
        [
            self.quad(min, y, z, materials[0]),
            self.quad(min + x, z, y, materials[1]),
            self.quad(min, z, x, materials[2]),
            self.quad(min + y, x, z, materials[3]),
            self.quad(min, x, y, materials[4]),
            self.quad(min + z, y, x, materials[5]),
        ]
    }

    pub fn lamp(&mut self, kind: LampKind) {
        self.scene.lamps.push(Lamp { name: "lamp".into(), kind });
    }

    pub fn point(&mut self, position_world: Vec3, watts_per_sr: f32) {
        self.lamp(LampKind::Point {
            position_world,
            intensity: Intensity::grey(watts_per_sr),
            range_m: None,
            radius_m: 0.0,
            soft_falloff: false,
            cone: None,
        });
    }

    pub fn sun(&mut self, toward_world: Vec3, irradiance: f32, angle_rad: f32) {
        let toward_world = toward_world.normalize();
        self.lamp(LampKind::Sun { toward_world, irradiance: Irradiance::grey(irradiance), angle_rad });
    }

    pub fn sky(&mut self, radiance: f32) {
        self.scene.sky = Sky::Constant(Radiance::grey(radiance));
    }

    /// Moves everything, as a scene far from the origin would be.
    pub fn offset(mut self, by: DVec3) -> Self {
        self.scene.origin_world += by;
        self
    }

    pub fn light(&self, quality: Quality, page_size: u32) -> Lit {
        light(&self.scene, quality, page_size)
    }
}

pub fn options(quality: Quality, page_size: u32) -> BakeOptions {
    let mut options = BakeOptions { light: quality.light(), ..BakeOptions::default() };
    options.atlas.page_size = page_size;
    options
}

pub fn light(scene: &Scene, quality: Quality, page_size: u32) -> Lit {
    bake::light(scene, &options(quality, page_size), &Run::default()).expect("the scene can be lit")
}

/// Irradiance at the element of a surface that is nearest to a world position.
pub fn at(lit: &Lit, surface: usize, position: Vec3) -> Irradiance {
    lit.irradiance(nearest(lit, surface, position))
}

/// The element of a surface nearest to a world position.
pub fn nearest(lit: &Lit, surface: usize, position: Vec3) -> usize {
    of_surface(lit, surface)
        .min_by(|&a, &b| {
            let distance = |e: usize| lit.elements.position_world[e].distance_squared(position);
            distance(a).total_cmp(&distance(b))
        })
        .expect("the surface has elements")
}

/// All valid elements of the front of a surface.
pub fn of_surface(lit: &Lit, surface: usize) -> impl Iterator<Item = usize> + '_ {
    let charts = lit.elements.charts.iter().filter(move |c| c.surface as usize == surface && !c.back);
    charts.flat_map(|c| c.elements.start as usize..c.elements.end as usize).filter(|&e| lit.elements.valid[e])
}

/// Area-weighted mean irradiance over all valid elements of exported pages.
pub fn mean(lit: &Lit) -> f64 {
    let (mut sum, mut area) = (0.0, 0.0);
    for chart in lit.elements.charts.iter().filter(|c| c.exported) {
        for e in chart.elements.start as usize..chart.elements.end as usize {
            if lit.elements.valid[e] {
                sum += f64::from(lit.irradiance(e).mean()) * f64::from(lit.elements.area[e].0);
                area += f64::from(lit.elements.area[e].0);
            }
        }
    }
    sum / area
}

/// Asserts that two numbers agree within a relative error.
#[track_caller]
pub fn close(actual: f32, expected: f32, relative: f32, what: &str) {
    let error = (actual - expected).abs() / expected.abs().max(f32::MIN_POSITIVE);
    assert!(error <= relative, "{what}: {actual} instead of {expected}, off by {error:e} > {relative:e}");
}

/// Every .gltf and .glb below these folders of the collection beside the project, in order; `None` where there is none.
pub fn shared_scenes(folders: &[&str]) -> Option<Vec<PathBuf>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let shared =
        ["../shared/scenes", "../../shared/scenes"].iter().map(|p| root.join(p)).find(|p| p.is_dir())?;
    let mut found = Vec::new();
    let mut waiting: Vec<PathBuf> = folders.iter().map(|folder| shared.join(folder)).collect();
    while let Some(folder) = waiting.pop() {
        for entry in std::fs::read_dir(&folder).expect("a folder can be listed").flatten() {
            let path = entry.path();
            match path.extension().and_then(|extension| extension.to_str()) {
                _ if path.is_dir() => waiting.push(path),
                Some("gltf" | "glb") => found.push(path),
                _ => {}
            }
        }
    }
    found.sort();
    Some(found)
}
