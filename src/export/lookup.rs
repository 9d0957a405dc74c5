//! Reading pages of light: at a point, and over a triangle.

use glam::{Vec2, Vec3};

/// A mean over a triangle takes points this far apart, texels.
const MEAN_STEP: f32 = 2.0;
/// The most points along a side of a triangle.
const MOST_STEPS: f32 = 64.0;

/// The value at a point in texels from the top left corner, bilinear, clamped to the page; `value` has
/// `size[0] * size[1]` rows, both at least one.
pub(crate) fn bilinear(value: &[Vec3], size: [usize; 2], at_texels: Vec2) -> Vec3 {
    let [width, height] = size.map(|side| side as f32);
    let p = at_texels - 0.5;
    let low = p.floor();
    let f = p - low;
    let column = |x: f32| x.clamp(0.0, width - 1.0) as usize;
    let row = |y: f32| y.clamp(0.0, height - 1.0) as usize * size[0];
    let (x, y) = ([column(low.x), column(low.x + 1.0)], [row(low.y), row(low.y + 1.0)]);
    let top = value[y[0] + x[0]].lerp(value[y[0] + x[1]], f.x);
    let bottom = value[y[1] + x[0]].lerp(value[y[1] + x[1]], f.x);
    top.lerp(bottom, f.y)
}

/// The mean over a triangle on the page, corners in texels: from the middles of equal small ones.
pub(crate) fn mean_over_triangle(value: &[Vec3], size: [usize; 2], [a, b, c]: [Vec2; 3]) -> Vec3 {
    let longest = (b - a).length().max((c - b).length()).max((a - c).length());
    let steps = (longest / MEAN_STEP).ceil().clamp(1.0, MOST_STEPS) as u32;
    let (u, v) = ((b - a) / steps as f32, (c - a) / steps as f32);
    let mut sum = Vec3::ZERO;
    for i in 0..steps {
        for j in 0..steps - i {
            let corner = a + u * i as f32 + v * j as f32;
            sum += bilinear(value, size, corner + (u + v) / 3.0);
            if i + j + 1 < steps {
                sum += bilinear(value, size, corner + (u + v) * (2.0 / 3.0));
            }
        }
    }
    sum / (steps * steps) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mean_of_a_slope_is_its_value_in_the_middle() {
        let value: Vec<Vec3> =
            (0..64 * 64).map(|i| Vec3::new((i % 64) as f32, (i / 64) as f32, 1.0)).collect();
        let corners = [Vec2::new(2.5, 3.0), Vec2::new(50.0, 7.25), Vec2::new(11.0, 60.0)];
        let mean = mean_over_triangle(&value, [64, 64], corners);
        let middle = (corners[0] + corners[1] + corners[2]) / 3.0 - 0.5;
        assert!((mean - Vec3::new(middle.x, middle.y, 1.0)).abs().max_element() < 1e-3, "{mean} {middle}");
        assert_eq!(mean_over_triangle(&value, [64, 64], [Vec2::splat(9.5); 3]), Vec3::new(9.0, 9.0, 1.0));
    }
}
