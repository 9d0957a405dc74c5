//! The resolved world: surfaces in world metres, materials, lamps, sky. Knows no file format.
//!
//! Everything is relative to [`Scene::origin_world`], which is subtracted in f64 so that geometry far from the
//! origin keeps its precision. Axes are glTF's: y up, right-handed.

mod camera;
mod material;
mod opacity;
mod sky;
mod texture;

pub use camera::{Camera, Projection};
pub use material::{Alpha, Material, TextureSlot};
pub use opacity::Opacity;
pub use sky::{Sky, SkyImage};
pub use texture::{Filter, Pixels, Texture, Wrap};

use crate::error::Warning;
use crate::options::LampUnits;
use crate::units::{Intensity, Irradiance, Radiance, Reflectance};
use glam::{DAffine3, DVec3, Vec2, Vec3, Vec4};

/// Index into [`Scene::geometries`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct GeometryId(pub u32);

/// Index into [`Scene::materials`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct MaterialId(pub u32);

/// Index into [`Scene::textures`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct TextureId(pub u32);

/// Everything light can meet.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// Shapes in their own space; shared by the surfaces that place them.
    pub geometries: Vec<Geometry>,
    /// One per node × primitive × instance, in document order.
    pub surfaces: Vec<Surface>,
    /// Index 0 is the default material of primitives that name none.
    pub materials: Vec<Material>,
    /// Decoded images with their samplers.
    pub textures: Vec<Texture>,
    /// Punctual lamps.
    pub lamps: Vec<Lamp>,
    /// What rays meet that leave the scene.
    pub sky: Sky,
    /// Where it can be looked at from, in document order.
    pub cameras: Vec<Camera>,
    /// World position, metres, of the scene's local origin; subtracted from every position.
    pub origin_world: DVec3,
    /// How the numbers of the file's lamps were read; never [`LampUnits::Auto`] in an imported scene. With
    /// [`LampUnits::Gltf`] all light is photometric: lm and cd where the types say W and W/sr.
    pub lamp_units: LampUnits,
    /// Which of the file's scenes this is; `None` when it names none.
    pub index: Option<usize>,
    /// What was dropped or approximated on the way in.
    pub warnings: Vec<Warning>,
}

/// A triangle mesh in its own space: one primitive of one glTF mesh. Vertex order and triangle order are the file's
/// (strips and fans expanded in order); degenerate triangles stay, so that both can be written back.
#[derive(Clone, Debug, Default)]
pub struct Geometry {
    /// The mesh's name, for messages.
    pub name: String,
    /// Vertex positions, local units.
    pub position_local: Vec<Vec3>,
    /// Vertex normals, unit length, local; means of the faces around where the file has none.
    pub normal_local: Vec<Vec3>,
    /// Texture coordinate sets, each as long as `position_local`.
    pub texcoords: Vec<Vec<Vec2>>,
    /// Linear vertex colour (COLOR_0); empty when the file has none.
    pub color: Vec<Vec4>,
    /// Vertex indices, counter-clockwise from the front.
    pub triangles: Vec<[u32; 3]>,
    /// Whether any vertex normal leaves its triangle's plane normal by more than half a degree. False for primitives
    /// without normals, which glTF wants flat: then [`Scene::shading_normal`] is the triangle's plane normal.
    pub smooth: bool,
    /// Whether triangles of an unindexed, flat-shaded primitive share no vertices although they touch.
    pub unindexed: bool,
}

/// Where a surface comes from, in the file's own numbering.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Origin {
    /// The node's name, or "node N".
    pub name: String,
    /// glTF node index.
    pub node: usize,
    /// glTF mesh index.
    pub mesh: usize,
    /// Primitive index inside the mesh.
    pub primitive: usize,
    /// Instance number when EXT_mesh_gpu_instancing was expanded.
    pub instance: Option<usize>,
}

/// What a surface is to light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// Gets texels in a page that is written, and reflects.
    Lightmapped,
    /// Blocks and reflects light but gets no lightmap (skinned, morphed, excluded by the artist).
    Reflects,
    /// Only blocks light (unlit materials).
    Blocks,
    /// Only gives light: no ray meets it and it takes none (area lamps). Its material's alpha is a hole everywhere, its
    /// [`Origin::mesh`] is none of the file's.
    Emits,
}

/// A placed geometry.
#[derive(Clone, Debug)]
pub struct Surface {
    /// Where it comes from.
    pub origin: Origin,
    /// Its shape.
    pub geometry: GeometryId,
    /// Its material.
    pub material: MaterialId,
    /// Local space to world space, before [`Scene::origin_world`] is subtracted.
    pub world_from_local: DAffine3,
    /// Vertex positions, world metres relative to [`Scene::origin_world`]; same order as the geometry's.
    pub position_world: Vec<Vec3>,
    /// Vertex normals, world, unit length.
    pub normal_world: Vec<Vec3>,
    /// Whether `world_from_local` mirrors: then the winding of every triangle is turned, see [`Scene::corner_indices`].
    pub mirrored: bool,
    /// What it is to light.
    pub role: Role,
    /// Multiplies the bake's texel density (the artist's `extras.lightkiln.density`); 1 by default.
    pub density_factor: f32,
}

/// A point on a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// Index into [`Scene::surfaces`].
    pub surface: u32,
    /// Index into the geometry's triangles.
    pub triangle: u32,
    /// Weights of the second and third corner as [`Scene::corner_indices`] orders them.
    pub barycentric: Vec2,
}

/// Which curve a spot lamp follows between its inner and outer cone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SpotFalloff {
    /// smoothstep((cosθ−cosO)/((1−cosO)·b)), b = 1 − inner/outer: Blender Cycles.
    Blender,
    /// ((cosθ−cosO)/(cosI−cosO))²: KHR_lights_punctual.
    Gltf,
}

/// The cone of a spot lamp.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cone {
    /// Unit vector along the beam, world.
    pub direction_world: Vec3,
    /// Half angle of full strength, radians.
    pub inner_rad: f32,
    /// Half angle where the light ends, radians.
    pub outer_rad: f32,
    /// The curve between the two.
    pub falloff: SpotFalloff,
}

/// The kinds of lamps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LampKind {
    /// A small source: E = I cosθ/d², inside a cone for spots.
    Point {
        /// Position, world metres relative to the scene's origin.
        position_world: Vec3,
        /// Power per solid angle along the axis.
        intensity: Intensity,
        /// Distance at which the light is cut off smoothly, metres.
        range_m: Option<f32>,
        /// Radius of the luminous sphere, metres; 0 is a point.
        radius_m: f32,
        /// Blender's Soft Falloff: a disc of that radius that faces whatever it lights, E = I cosθ/(d² + r²), so that
        /// nothing nearby burns out.
        soft_falloff: bool,
        /// The cone, for spots.
        cone: Option<Cone>,
    },
    /// A distant source: E = S cosθ.
    Sun {
        /// Unit vector towards the sun, world.
        toward_world: Vec3,
        /// Irradiance on a surface that faces the sun.
        irradiance: Irradiance,
        /// Angular diameter, radians; 0 is sharp.
        angle_rad: f32,
    },
}

/// A lamp with its name.
#[derive(Clone, Debug, PartialEq)]
pub struct Lamp {
    /// The node's name.
    pub name: String,
    /// What it sends.
    pub kind: LampKind,
}

impl Scene {
    /// Vertex indices of a triangle, counter-clockwise from the front in world space (mirrored surfaces turned).
    #[inline]
    pub fn corner_indices(&self, surface: &Surface, triangle: u32) -> [usize; 3] {
        let [a, b, c] = self.geometry(surface).triangles[triangle as usize].map(|i| i as usize);
        if surface.mirrored { [a, c, b] } else { [a, b, c] }
    }

    /// World corner positions of a triangle, counter-clockwise from the front.
    #[inline]
    pub fn corners_world(&self, surface: &Surface, triangle: u32) -> [Vec3; 3] {
        self.corner_indices(surface, triangle).map(|i| surface.position_world[i])
    }

    /// The shape of a surface.
    #[inline]
    pub fn geometry(&self, surface: &Surface) -> &Geometry {
        &self.geometries[surface.geometry.0 as usize]
    }

    /// The material of a surface.
    #[inline]
    pub fn material(&self, surface: &Surface) -> &Material {
        &self.materials[surface.material.0 as usize]
    }

    /// Whether any lamp sends out light.
    pub fn lamps_shine(&self) -> bool {
        (0..self.lamps.len()).any(|lamp| self.lamp_shines(lamp))
    }

    /// Whether a lamp sends out light.
    pub fn lamp_shines(&self, lamp: usize) -> bool {
        match self.lamps[lamp].kind {
            LampKind::Point { intensity, .. } => intensity.0.max_element() > 0.0,
            LampKind::Sun { irradiance, .. } => irradiance.0.max_element() > 0.0,
        }
    }

    /// Diffuse reflectance at a point: base colour × texture × vertex colour × (1 − metallic).
    pub fn reflectance(&self, at: SurfacePoint) -> Reflectance {
        let (surface, material) = self.at(at);
        if material.unlit {
            return Reflectance::ZERO;
        }
        let mut color = self.base_color(surface, material, at).truncate();
        let mut metallic = material.metallic;
        if let Some(slot) = &material.metallic_texture {
            metallic *= self.sample(surface, slot, at).z;
        }
        color *= (1.0 - metallic).clamp(0.0, 1.0) * (1.0 - material.transmission).clamp(0.0, 1.0);
        Reflectance::clamped(color)
    }

    /// Emitted radiance at a point of the front.
    pub fn emission(&self, at: SurfacePoint) -> Radiance {
        let (surface, material) = self.at(at);
        if material.unlit {
            return Radiance::ZERO;
        }
        match &material.emission_texture {
            Some(slot) => {
                Radiance(material.emission.0 * self.sample(surface, slot, at).truncate().max(Vec3::ZERO))
            }
            None => material.emission,
        }
    }

    /// Opacity at a point and the tint of what passes: `(opacity, transmitted colour)`; cutoff applied for masks.
    pub fn opacity(&self, at: SurfacePoint) -> (f32, Vec3) {
        let (surface, material) = self.at(at);
        match material.alpha {
            Alpha::Opaque => (1.0, Vec3::ZERO),
            Alpha::Mask { cutoff } => {
                let alpha = self.base_color(surface, material, at).w;
                (if alpha >= cutoff { 1.0 } else { 0.0 }, Vec3::ONE)
            }
            Alpha::Blend => {
                let color = self.base_color(surface, material, at);
                (color.w.clamp(0.0, 1.0), color.truncate().clamp(Vec3::ZERO, Vec3::ONE))
            }
        }
    }

    /// Shading normal, world, unit length: interpolated where the geometry is smooth, else the triangle's own.
    pub fn shading_normal(&self, at: SurfacePoint) -> Vec3 {
        let surface = &self.surfaces[at.surface as usize];
        let [a, b, c] = self.corner_indices(surface, at.triangle).map(|i| surface.normal_world[i]);
        if !self.geometry(surface).smooth {
            return self.plane_normal(surface, at.triangle).unwrap_or(a);
        }
        (a * (1.0 - at.barycentric.x - at.barycentric.y) + b * at.barycentric.x + c * at.barycentric.y)
            .try_normalize()
            .unwrap_or(a)
    }

    /// Normal of a triangle's plane on its front, world, unit length; `None` when it has no area.
    pub fn plane_normal(&self, surface: &Surface, triangle: u32) -> Option<Vec3> {
        // In f64, where the products of small edges do not vanish.
        let [a, b, c] = self.corners_world(surface, triangle).map(Vec3::as_dvec3);
        (b - a).cross(c - a).try_normalize().map(|normal| normal.as_vec3())
    }

    /// World position of a point.
    pub fn position(&self, at: SurfacePoint) -> Vec3 {
        let [a, b, c] = self.corners_world(&self.surfaces[at.surface as usize], at.triangle);
        a + (b - a) * at.barycentric.x + (c - a) * at.barycentric.y
    }

    fn at(&self, at: SurfacePoint) -> (&Surface, &Material) {
        let surface = &self.surfaces[at.surface as usize];
        (surface, self.material(surface))
    }

    /// Linear base colour and alpha at a point: factor × texture × vertex colour.
    pub fn color(&self, at: SurfacePoint) -> Vec4 {
        let (surface, material) = self.at(at);
        self.base_color(surface, material, at)
    }

    /// Texture coordinates of a point in one of its geometry's sets; `None` when there is no such set.
    pub fn texcoord(&self, at: SurfacePoint, set: usize) -> Option<Vec2> {
        let surface = &self.surfaces[at.surface as usize];
        let rows = self.geometry(surface).texcoords.get(set)?;
        Some(self.interpolate(surface, at, rows, |uv| uv))
    }

    fn base_color(&self, surface: &Surface, material: &Material, at: SurfacePoint) -> Vec4 {
        let mut color = material.base_color;
        if let Some(slot) = &material.base_color_texture {
            color *= self.sample(surface, slot, at);
        }
        let geometry = self.geometry(surface);
        if !geometry.color.is_empty() {
            color *= self.interpolate(surface, at, &geometry.color, |v| v);
        }
        color
    }

    fn sample(&self, surface: &Surface, slot: &TextureSlot, at: SurfacePoint) -> Vec4 {
        let geometry = self.geometry(surface);
        let Some(set) = geometry.texcoords.get(slot.texcoord) else {
            return self.textures[slot.texture.0 as usize].sample(Vec2::ZERO);
        };
        let uv: Vec2 = self.interpolate(surface, at, set, |v| v);
        self.textures[slot.texture.0 as usize].sample(slot.transform.transform_point2(uv))
    }

    fn interpolate<T: Copy, V>(
        &self,
        surface: &Surface,
        at: SurfacePoint,
        rows: &[T],
        read: impl Fn(T) -> V,
    ) -> V
    where
        V: std::ops::Mul<f32, Output = V> + std::ops::Add<Output = V>,
    {
        let [a, b, c] = self.corner_indices(surface, at.triangle).map(|i| read(rows[i]));
        a * (1.0 - at.barycentric.x - at.barycentric.y) + b * at.barycentric.x + c * at.barycentric.y
    }
}
