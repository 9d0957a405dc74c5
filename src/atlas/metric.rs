//! The 2×2 metric of a flattened triangle: what a step in texture space is worth on the surface.

use glam::{DMat2, DMat3, DVec2, DVec3};

/// Symmetric matrix `[[xx, xy], [xy, yy]]`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Metric {
    pub xx: f64,
    pub xy: f64,
    pub yy: f64,
}

impl Metric {
    /// Metric of a triangle with the given corners; `space` is MᵀM of the linear map from the corners' space to the
    /// world. `None` when the flattened triangle has no area.
    pub fn of(corners: [DVec3; 3], flat: [DVec2; 3], space: DMat3) -> Option<Self> {
        let uv = DMat2::from_cols(flat[1] - flat[0], flat[2] - flat[0]);
        let determinant = uv.determinant();
        if determinant == 0.0 || !determinant.is_finite() {
            return None;
        }
        let edge = [corners[1] - corners[0], corners[2] - corners[0]];
        // The metric of the edges, then through the inverse of the flattened edges on both sides.
        let gram = Self {
            xx: edge[0].dot(space * edge[0]),
            xy: edge[0].dot(space * edge[1]),
            yy: edge[1].dot(space * edge[1]),
        };
        let metric = gram.through(uv.inverse());
        (metric.xx.is_finite() && metric.xy.is_finite() && metric.yy.is_finite()).then_some(metric)
    }

    /// AᵀGA.
    pub fn through(self, a: DMat2) -> Self {
        let g = DMat2::from_cols(DVec2::new(self.xx, self.xy), DVec2::new(self.xy, self.yy));
        let m = a.transpose() * g * a;
        Self { xx: m.x_axis.x, xy: 0.5 * (m.x_axis.y + m.y_axis.x), yy: m.y_axis.y }
    }

    /// Adds `weight` times another.
    pub fn add(&mut self, other: Self, weight: f64) {
        self.xx += weight * other.xx;
        self.xy += weight * other.xy;
        self.yy += weight * other.yy;
    }

    /// Eigenvalues, the smaller first, never negative.
    pub fn eigenvalues(self) -> [f64; 2] {
        let mean = 0.5 * (self.xx + self.yy);
        let apart = (0.5 * (self.xx - self.yy)).hypot(self.xy);
        // The smaller through the determinant: the difference would cancel.
        let large = mean + apart;
        let small = if large > 0.0 { (self.xx * self.yy - self.xy * self.xy) / large } else { 0.0 };
        [small.max(0.0), large.max(0.0)]
    }

    /// The symmetric square root: the map that makes this metric the identity. Directions that (almost) vanish keep
    /// a thousandth of the other, so that the map can be undone. `None` when nothing is left.
    pub fn root(self) -> Option<DMat2> {
        let [small, large] = self.eigenvalues();
        if large <= 0.0 || !large.is_finite() {
            return None;
        }
        let axis = if self.xy == 0.0 {
            if self.xx >= self.yy { DVec2::X } else { DVec2::Y }
        } else {
            // Of the two forms of the eigenvector, the one that does not cancel.
            let vector = if self.xx >= self.yy {
                DVec2::new(large - self.yy, self.xy)
            } else {
                DVec2::new(self.xy, large - self.xx)
            };
            vector.try_normalize()?
        };
        let long = large.sqrt();
        let short = small.sqrt().max(1e-3 * long);
        let outer = |a: DVec2, s: f64| DMat2::from_cols(a * (a.x * s), a * (a.y * s));
        let root = outer(axis, long) + outer(axis.perp(), short);
        Some(root)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_root_squares_to_the_metric() {
        let metric = Metric { xx: 4.0, xy: 1.5, yy: 9.0 };
        let root = metric.root().unwrap();
        let square = root * root;
        assert!((square.x_axis - DVec2::new(4.0, 1.5)).length() < 1e-12);
        assert!((square.y_axis - DVec2::new(1.5, 9.0)).length() < 1e-12);
    }

    #[test]
    fn a_flattened_triangle_measures_its_stretch() {
        let corners = [DVec3::ZERO, DVec3::X * 6.0, DVec3::Z * 2.0];
        let flat = [DVec2::ZERO, DVec2::X * 2.0, DVec2::Y];
        let metric = Metric::of(corners, flat, DMat3::IDENTITY).unwrap();
        assert_eq!(metric, Metric { xx: 9.0, xy: 0.0, yy: 4.0 });
        assert_eq!(metric.eigenvalues(), [4.0, 9.0]);
    }
}
