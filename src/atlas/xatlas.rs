//! The home of xatlas: charts of small smooth pieces. Packing is not asked of it, see `xatlas_shim.cpp`.

use glam::{Vec2, Vec3};
use std::ffi::{c_int, c_void};

/// A connected mesh to cut and flatten: finite, indices in range, no degenerate triangle, scaled so that a typical
/// edge has length 1 (xatlas's tolerances are absolute).
pub(super) struct Piece {
    pub position: Vec<Vec3>,
    pub normal: Vec<Vec3>,
    pub triangles: Vec<[u32; 3]>,
}

/// One flattened chart of a piece.
#[derive(Debug)]
pub(super) struct FlatChart {
    /// Triangles of the piece.
    pub triangles: Vec<u32>,
    /// Flattened corners of each, any scale, possibly mirrored.
    pub corner_uv: Vec<[Vec2; 3]>,
}

/// Why there are no charts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum NoCharts {
    /// The callback said stop.
    Stopped,
    /// xatlas refused or failed.
    Failed,
}

/// How dear it is to cross an edge whose normals differ; xatlas's default.
const NORMAL_SEAM_WEIGHT: f32 = 4.0;
/// A chart grows until this cost; xatlas's default.
const MAX_COST: f32 = 2.0;

#[repr(C)]
struct Charts {
    _private: [u8; 0],
}

type Continue = unsafe extern "C" fn(*mut c_void) -> bool;

unsafe extern "C" {
    fn lightkiln_xatlas_charts(
        vertices: u32,
        position: *const f32,
        normal: *const f32,
        triangles: u32,
        index: *const u32,
        normal_seam_weight: f32,
        max_cost: f32,
        go_on: Continue,
        user: *mut c_void,
        result: *mut *mut Charts,
    ) -> c_int;
    fn lightkiln_xatlas_chart_count(charts: *const Charts) -> u32;
    fn lightkiln_xatlas_face_count(charts: *const Charts) -> u32;
    fn lightkiln_xatlas_copy(
        charts: *const Charts,
        first_face: *mut u32,
        face: *mut u32,
        corner_uv: *mut f32,
    );
    fn lightkiln_xatlas_free(charts: *mut Charts);
}

/// Charts of a piece. Triangles that xatlas ignores (no area) are in none. `go_on` is asked now and then.
pub(super) fn charts<F: Fn() -> bool>(piece: &Piece, go_on: &F) -> Result<Vec<FlatChart>, NoCharts> {
    unsafe extern "C" fn ask<F: Fn() -> bool>(user: *mut c_void) -> bool {
        // SAFETY: `user` is the `&F` given below, alive for the whole call; xatlas is built without threads.
        let go_on = unsafe { &*user.cast::<F>() };
        go_on()
    }
    let (vertices, triangles) = (u32::try_from(piece.position.len()), u32::try_from(piece.triangles.len()));
    let (Ok(vertices), Ok(triangles)) = (vertices, triangles) else { return Err(NoCharts::Failed) };
    if triangles > u32::MAX / 3 || !sound(piece) {
        return Err(NoCharts::Failed);
    }
    let mut result = std::ptr::null_mut();
    // SAFETY: the arrays have the lengths that are told, all indices were checked, `go_on` outlives the call.
    let code = unsafe {
        lightkiln_xatlas_charts(
            vertices,
            bytemuck::cast_slice::<Vec3, f32>(&piece.position).as_ptr(),
            bytemuck::cast_slice::<Vec3, f32>(&piece.normal).as_ptr(),
            triangles,
            bytemuck::cast_slice::<[u32; 3], u32>(&piece.triangles).as_ptr(),
            NORMAL_SEAM_WEIGHT,
            MAX_COST,
            ask::<F>,
            std::ptr::from_ref(go_on).cast_mut().cast(),
            &mut result,
        )
    };
    match code {
        0 => Ok(take(result, triangles)),
        1 => Err(NoCharts::Stopped),
        _ => Err(NoCharts::Failed),
    }
}

fn sound(piece: &Piece) -> bool {
    let vertices = piece.position.len();
    piece.normal.len() == vertices
        && piece.position.iter().chain(&piece.normal).all(|row| row.is_finite())
        && piece.triangles.iter().flatten().all(|&corner| (corner as usize) < vertices)
}

/// Copies the result out and frees it.
fn take(result: *mut Charts, triangles: u32) -> Vec<FlatChart> {
    // SAFETY: `result` is a live result of `lightkiln_xatlas_charts`; the arrays have the lengths it says; it is
    // freed once and not used after.
    let (first_face, face, uv) = unsafe {
        let charts = lightkiln_xatlas_chart_count(result) as usize;
        let faces = lightkiln_xatlas_face_count(result) as usize;
        let (mut first_face, mut face) = (vec![0u32; charts + 1], vec![0u32; faces]);
        let mut uv = vec![[Vec2::ZERO; 3]; faces];
        let floats = bytemuck::cast_slice_mut::<[Vec2; 3], f32>(&mut uv);
        lightkiln_xatlas_copy(result, first_face.as_mut_ptr(), face.as_mut_ptr(), floats.as_mut_ptr());
        lightkiln_xatlas_free(result);
        (first_face, face, uv)
    };
    let chart = |ends: &[u32]| {
        let rows = (ends[0] as usize..ends[1] as usize).filter(|&row| face[row] < triangles);
        let (triangles, corner_uv) = rows.map(|row| (face[row], uv[row])).unzip();
        FlatChart { triangles, corner_uv }
    };
    first_face.windows(2).map(chart).collect()
}
