//! The few functions of Embree 4 the comparison needs, loaded at run time.

use glam::Vec3;
use libloading::Library;
use lightkiln::transport::Ray;
use std::ffi::{OsStr, c_char, c_void};

type Handle = *mut c_void;

/// RTCRayHit, with room for the instance ids of any build.
#[repr(C, align(64))]
#[derive(Clone, Copy)]
struct RayHit {
    origin: [f32; 3],
    t_near: f32,
    direction: [f32; 3],
    time: f32,
    t_far: f32,
    mask: u32,
    id: u32,
    flags: u32,
    normal: [f32; 3],
    uv: [f32; 2],
    primitive: u32,
    geometry: u32,
    instance: [u32; 5],
}

/// A committed scene.
pub struct Embree {
    scene: Handle,
    intersect: unsafe extern "C" fn(Handle, *mut RayHit, *mut c_void),
    occluded: unsafe extern "C" fn(Handle, *mut RayHit, *mut c_void),
}

const ROBUST: u32 = 1 << 2;
const BUFFER_INDEX: u32 = 0;
const BUFFER_VERTEX: u32 = 1;
const UINT3: u32 = 0x5003;
const FLOAT3: u32 = 0x9003;

impl Embree {
    /// Loads the library (and keeps it: its threads do not survive unloading) and builds with default quality.
    pub fn new(library: &OsStr, triangles: &[[Vec3; 3]], robust: bool) -> Self {
        // SAFETY: the caller names an Embree 4 library; the signatures are those of its rtcore.h.
        unsafe {
            let library = Box::leak(Box::new(Library::new(library).expect("Embree 4 library")));
            macro_rules! load {
                ($name:literal, fn($($argument:ty),*) -> $result:ty) => {
                    *library
                        .get::<unsafe extern "C" fn($($argument),*) -> $result>($name.as_bytes())
                        .expect($name)
                };
            }
            let device = load!("rtcNewDevice", fn(*const c_char) -> Handle)(c"threads=1".as_ptr());
            let scene = load!("rtcNewScene", fn(Handle) -> Handle)(device);
            if robust {
                load!("rtcSetSceneFlags", fn(Handle, u32) -> ())(scene, ROBUST);
            }
            let geometry = load!("rtcNewGeometry", fn(Handle, u32) -> Handle)(device, 0);
            let buffer =
                load!("rtcSetNewGeometryBuffer", fn(Handle, u32, u32, u32, usize, usize) -> *mut c_void);
            let count = triangles.len();
            let vertices = buffer(geometry, BUFFER_VERTEX, 0, FLOAT3, 12, 3 * count).cast::<[Vec3; 3]>();
            let indices = buffer(geometry, BUFFER_INDEX, 0, UINT3, 12, count).cast::<[u32; 3]>();
            for (i, triangle) in triangles.iter().enumerate() {
                vertices.add(i).write_unaligned(*triangle);
                indices.add(i).write_unaligned([0, 1, 2].map(|k| 3 * i as u32 + k));
            }
            load!("rtcCommitGeometry", fn(Handle) -> ())(geometry);
            load!("rtcAttachGeometry", fn(Handle, Handle) -> u32)(scene, geometry);
            load!("rtcCommitScene", fn(Handle) -> ())(scene);
            Self {
                scene,
                intersect: load!("rtcIntersect1", fn(Handle, *mut RayHit, *mut c_void) -> ()),
                occluded: load!("rtcOccluded1", fn(Handle, *mut RayHit, *mut c_void) -> ()),
            }
        }
    }

    pub fn sum_distances(&self, rays: &[Ray]) -> f64 {
        flushing_denormals(|| {
            let found = rays.iter().filter_map(|ray| {
                let mut hit = RayHit::new(ray);
                // SAFETY: the scene is committed and the record has Embree's layout and alignment.
                unsafe { (self.intersect)(self.scene, &mut hit, std::ptr::null_mut()) };
                (hit.geometry != u32::MAX).then_some(f64::from(hit.t_far))
            });
            found.sum()
        })
    }

    pub fn count_occluded(&self, rays: &[Ray]) -> f64 {
        flushing_denormals(|| {
            let blocked = rays.iter().filter(|ray| {
                let mut hit = RayHit::new(ray);
                // SAFETY: as above; an RTCRay is the head of the record.
                unsafe { (self.occluded)(self.scene, &mut hit, std::ptr::null_mut()) };
                hit.t_far < 0.0
            });
            blocked.count() as f64
        })
    }
}

impl RayHit {
    fn new(ray: &Ray) -> Self {
        Self {
            origin: ray.origin.to_array(),
            t_near: 0.0,
            direction: ray.direction.to_array(),
            time: 0.0,
            t_far: ray.t_max,
            mask: u32::MAX,
            id: 0,
            flags: 0,
            normal: [0.0; 3],
            uv: [0.0; 2],
            primitive: u32::MAX,
            geometry: u32::MAX,
            instance: [u32::MAX; 5],
        }
    }
}

/// Runs with the processor mode that Embree's manual recommends.
#[cfg(target_arch = "x86_64")]
fn flushing_denormals<T>(work: impl FnOnce() -> T) -> T {
    const FLUSH_AND_ZERO: u32 = 0x8040;
    let mut before = 0u32;
    // SAFETY: only the denormal bits change, and they are put back below.
    unsafe {
        std::arch::asm!("stmxcsr [{}]", in(reg) &mut before);
        std::arch::asm!("ldmxcsr [{}]", in(reg) &(before | FLUSH_AND_ZERO));
    }
    let result = work();
    // SAFETY: the mode that was found.
    unsafe { std::arch::asm!("ldmxcsr [{}]", in(reg) &before) };
    result
}

#[cfg(not(target_arch = "x86_64"))]
fn flushing_denormals<T>(work: impl FnOnce() -> T) -> T {
    work()
}
