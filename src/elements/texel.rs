//! One texel's part of a chart: the pieces of triangles in it, and where its sample goes.

use super::charts::Mapped;
use glam::{DVec2, DVec3};

/// The part of one triangle inside one texel.
#[derive(Clone, Copy, Debug)]
pub(super) struct Piece {
    /// Index into the band's texels.
    pub texel: u32,
    /// Triangle of the geometry.
    pub triangle: u32,
    /// World area, m².
    pub area: f64,
    /// Area in texels².
    pub coverage: f32,
    /// Centroid, relative to the texel's top left corner.
    pub centroid: [f32; 2],
}

/// A point of the chart.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    /// Index into the texel's pieces.
    pub piece: usize,
    /// Weights of the triangle's corners.
    pub weights: DVec3,
    /// Half the width, in texels and at most 0.5, of the square around it that stays on the chart.
    pub reach: f64,
}

/// The pieces of one texel with their triangles.
pub(super) struct Footprint<'a> {
    /// Top left corner on the page.
    pub corner: DVec2,
    /// Ascending by triangle.
    pub pieces: &'a [Piece],
    pub mapped: &'a [Mapped],
}

/// A sample nearer to the chart's border than this share of a texel is pulled in where there is room: on the border
/// itself stands, in a room, the next wall.
pub(super) const COMFORTABLE: f64 = 0.125;

/// Relative to a triangle's weights: points on an edge belong to both its triangles.
const ON_EDGE: f64 = 1e-9;

impl Footprint<'_> {
    /// World area, m².
    pub(super) fn area(&self) -> f64 {
        self.pieces.iter().map(|piece| piece.area).sum()
    }

    /// Whether the chart covers the whole texel.
    fn is_full(&self) -> bool {
        self.pieces.iter().map(|piece| f64::from(piece.coverage)).sum::<f64>() >= 1.0 - 1e-6
    }

    /// Where the sample goes: the centre where that is on the chart and not at its border; else as near to it as is
    /// comfortable on the way to the centroid of the covered part; else the roomiest of these points.
    pub(super) fn place(&self) -> Place {
        let centre = self.corner + 0.5;
        if self.is_full()
            && let Some(place) = self.locate(centre, 0.5)
        {
            return place;
        }
        let covered = self.centroid();
        let mut best: Option<Place> = None;
        for step in 0..=4 {
            let p = centre.lerp(covered, 0.25 * f64::from(step));
            let Some(place) = self.roomy(p) else { continue };
            if place.reach >= COMFORTABLE {
                return place;
            }
            if best.is_none_or(|best| place.reach > best.reach) {
                best = Some(place);
            }
        }
        best.unwrap_or_else(|| self.in_largest_piece())
    }

    /// Other points of the texel that are on the chart, by distance from the centre, then row, then column.
    pub(super) fn others(&self) -> impl Iterator<Item = Place> + '_ {
        // The centres of a 4 × 4 grid, in eighths of a texel from the texel's centre.
        const GRID: [[i8; 2]; 16] = [
            [-1, -1],
            [1, -1],
            [-1, 1],
            [1, 1],
            [-1, -3],
            [1, -3],
            [-3, -1],
            [3, -1],
            [-3, 1],
            [3, 1],
            [-1, 3],
            [1, 3],
            [-3, -3],
            [3, -3],
            [-3, 3],
            [3, 3],
        ];
        let point = |[x, y]: [i8; 2]| self.corner + 0.5 + DVec2::new(f64::from(x), f64::from(y)) / 8.0;
        GRID.into_iter().filter_map(move |at| self.locate(point(at), COMFORTABLE))
    }

    /// Area-weighted centroid of the covered part; it may lie off a chart that is not convex.
    fn centroid(&self) -> DVec2 {
        let (mut sum, mut total) = (DVec2::ZERO, 0.0);
        for piece in self.pieces {
            sum += self.centroid_of(piece) * f64::from(piece.coverage);
            total += f64::from(piece.coverage);
        }
        if total > 0.0 { sum / total } else { self.centroid_of(&self.pieces[0]) }
    }

    fn centroid_of(&self, piece: &Piece) -> DVec2 {
        self.corner + DVec2::new(f64::from(piece.centroid[0]), f64::from(piece.centroid[1]))
    }

    /// The triangle at a point of the page, the first that has it.
    fn locate(&self, p: DVec2, reach: f64) -> Option<Place> {
        self.mapped.iter().enumerate().find_map(|(piece, triangle)| {
            let weights = triangle.weights(p)?;
            let inside = weights.min_element() >= -ON_EDGE;
            inside.then(|| Place { piece, weights: onto_triangle(weights), reach })
        })
    }

    /// The triangle at a point and how far the chart reaches around it.
    fn roomy(&self, p: DVec2) -> Option<Place> {
        let mut place = self.locate(p, 0.0)?;
        let on_chart = |s: f64| {
            let d = s * std::f64::consts::FRAC_1_SQRT_2;
            let around = [[s, 0.0], [-s, 0.0], [0.0, s], [0.0, -s], [d, d], [-d, d], [d, -d], [-d, -d]];
            around.iter().all(|&[x, y]| self.locate(p + DVec2::new(x, y), 0.0).is_some())
        };
        let wide = [0.5, 0.375, 0.25, 0.1875, COMFORTABLE, 0.0625, 0.03125];
        place.reach = wide.into_iter().find(|&s| on_chart(s)).unwrap_or(0.0);
        Some(place)
    }

    /// The centroid of the piece with the greatest area; for slivers nothing else is certain to be on the chart.
    fn in_largest_piece(&self) -> Place {
        let larger = |best: usize, i: usize| {
            if self.pieces[i].area > self.pieces[best].area { i } else { best }
        };
        let piece = (1..self.pieces.len()).fold(0, larger);
        let weights = self.mapped[piece].weights(self.centroid_of(&self.pieces[piece]));
        let weights = weights.map_or(DVec3::splat(1.0 / 3.0), onto_triangle);
        Place { piece, weights, reach: 0.0 }
    }
}

/// Weights without the negative ones that rounding leaves.
fn onto_triangle(weights: DVec3) -> DVec3 {
    let weights = weights.max(DVec3::ZERO);
    weights / weights.element_sum()
}
