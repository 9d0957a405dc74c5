//! The home of uvunwrap: charts of smooth pieces that are too large for xatlas, whose time grows with the square.

use super::xatlas::{FlatChart, NoCharts, Piece};
use glam::Vec2;
use uvunwrap::{Density, MeshInput, Options, Packing};

/// Charts grow to about this many triangles: solving for one grows faster than its size.
const TRIANGLES_PER_CHART: f32 = 4000.0;
/// Scale at which charts are packed inside; they are packed anew, so as coarse as their f32 coordinates allow.
const TEXELS_PER_UNIT: f32 = 0.25;

/// Charts of a piece, as [`super::xatlas::charts`] gives them. Triangles may be left out.
pub(super) fn charts<F: Fn() -> bool + Sync>(piece: &Piece, go_on: &F) -> Result<Vec<FlatChart>, NoCharts> {
    let position: &[[f32; 3]] = bytemuck::cast_slice(&piece.position);
    let index: &[u32] = bytemuck::cast_slice(&piece.triangles);
    let area = piece.triangles.iter().map(|t| f64::from(area(piece, t))).sum::<f64>() as f32;
    let options = Options {
        max_chart_area: area * TRIANGLES_PER_CHART / piece.triangles.len().max(1) as f32,
        density: Density::Fixed { texels_per_unit: TEXELS_PER_UNIT, page_size: None },
        padding: 0,
        packing: Packing::Fast,
        ..Options::default()
    };
    let found = uvunwrap::generate_with_progress(&[MeshInput::new(position, index)], &options, |_| go_on());
    let atlas = match found {
        Ok(atlas) => atlas,
        Err(uvunwrap::Error::Cancelled) => return Err(NoCharts::Stopped),
        Err(_) => return Err(NoCharts::Failed),
    };
    let Some(mesh) = atlas.meshes.first() else { return Err(NoCharts::Failed) };
    let page = Vec2::new(atlas.width as f32, atlas.height as f32);
    let mut charts: Vec<FlatChart> = Vec::new();
    let mut place: Vec<usize> = vec![usize::MAX; atlas.chart_count as usize];
    for (t, corners) in mesh.indices.chunks_exact(3).enumerate() {
        let vertices = [0, 1, 2].map(|k| mesh.vertices[corners[k] as usize]);
        let [Some(chart), Some(b), Some(c)] = vertices.map(|v| v.chart) else { continue };
        let uv = vertices.map(|v| Vec2::from(v.uv) * page);
        // Corners of triangles it found degenerate collapse onto others'.
        if b != chart || c != chart || (uv[1] - uv[0]).perp_dot(uv[2] - uv[0]) == 0.0 {
            continue;
        }
        let slot = &mut place[chart as usize];
        if *slot == usize::MAX {
            *slot = charts.len();
            charts.push(FlatChart { triangles: Vec::new(), corner_uv: Vec::new() });
        }
        charts[*slot].triangles.push(t as u32);
        charts[*slot].corner_uv.push(uv);
    }
    Ok(charts)
}

fn area(piece: &Piece, triangle: &[u32; 3]) -> f32 {
    let [a, b, c] = triangle.map(|i| piece.position[i as usize]);
    (b - a).cross(c - a).length() * 0.5
}
