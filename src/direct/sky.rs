//! The part of a sky image that is too bright to be found by chance: taken out and shot as suns.

use super::sun::SunEmitter;
use crate::scene::{Sky, SkyImage};
use crate::units::{Irradiance, Radiance};
use glam::{DVec3, Vec3};
use std::f32::consts::PI;

/// A pixel this many times brighter than the mean is taken out of the smooth sky.
const BRIGHT: f32 = 16.0;
/// The most suns a sky is cut into.
const MOST_SUNS: usize = 64;

/// Splits a sky into suns and a remainder that rays may find by chance.
pub fn split(sky: &Sky) -> (Vec<SunEmitter>, Sky) {
    let Sky::Image(image) = sky else { return (Vec::new(), sky.clone()) };
    let [w, h] = image.size();
    let row_solid_angle = |y: u32| {
        let edge = |k: u32| (PI * k as f32 / h as f32).cos();
        (edge(y) - edge(y + 1)) * 2.0 * PI / w as f32
    };
    let mean = (0..h)
        .map(|y| {
            (0..w).map(|x| f64::from(image.pixel(x, y).mean())).sum::<f64>() * f64::from(row_solid_angle(y))
        })
        .sum::<f64>() as f32
        / (4.0 * PI);
    let limit = BRIGHT * mean;
    let mut bright = Vec::new();
    let mut rest = Vec::with_capacity(w as usize * h as usize);
    for y in 0..h {
        for x in 0..w {
            let Radiance(color) = image.pixel(x, y);
            let level = image.pixel(x, y).mean();
            if level > limit && limit > 0.0 {
                let kept = color * (limit / level);
                rest.push(kept);
                let (u, v) = ((x as f32 + 0.5) / w as f32, (y as f32 + 0.5) / h as f32);
                let solid_angle = row_solid_angle(y);
                bright.push(Cell {
                    direction: SkyImage::direction_world(u, v),
                    flux: (color - kept) * solid_angle,
                    solid_angle,
                });
            } else {
                rest.push(color);
            }
        }
    }
    if bright.is_empty() {
        return (Vec::new(), sky.clone());
    }
    let suns = cut(bright, MOST_SUNS).into_iter().map(|cells| sun(&cells)).collect();
    let rest = SkyImage::new([w, h], rest).map_or_else(|| sky.clone(), Sky::Image);
    (suns, rest)
}

struct Cell {
    direction: Vec3,
    flux: Vec3,
    solid_angle: f32,
}

/// Median cut: halves the group with the largest spread × flux until there are `most` groups or all are tight.
fn cut(cells: Vec<Cell>, most: usize) -> Vec<Vec<Cell>> {
    let mut groups = vec![cells];
    while groups.len() < most {
        let worst = groups
            .iter()
            .enumerate()
            .map(|(i, g)| (i, f64::from(spread(g)) * flux(g).element_sum()))
            .filter(|(i, _)| spread(&groups[*i]) > 0.02)
            .max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0)));
        let Some((i, _)) = worst else { break };
        let mut group = groups.swap_remove(i);
        let (min, max) = bounds(&group);
        let axis = (max - min).max_position();
        group.sort_by(|a, b| a.direction[axis].total_cmp(&b.direction[axis]));
        let half = flux(&group).element_sum() / 2.0;
        let mut sum = 0.0;
        let at = group.iter().position(|c| {
            sum += f64::from(c.flux.element_sum());
            sum >= half
        });
        let at = at.unwrap_or(0).clamp(1, group.len() - 1);
        let tail = group.split_off(at);
        groups.push(group);
        groups.push(tail);
    }
    groups
}

/// In f64: a large picture has millions of pixels, whose sum in f32 would stop growing.
fn flux(cells: &[Cell]) -> DVec3 {
    cells.iter().map(|c| c.flux.as_dvec3()).sum()
}

fn bounds(cells: &[Cell]) -> (Vec3, Vec3) {
    cells
        .iter()
        .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(lo, hi), c| (lo.min(c.direction), hi.max(c.direction)))
}

fn spread(cells: &[Cell]) -> f32 {
    let (min, max) = bounds(cells);
    if cells.len() < 2 { 0.0 } else { (max - min).length() }
}

fn sun(cells: &[Cell]) -> SunEmitter {
    let weighted = |c: &Cell| c.direction.as_dvec3() * f64::from(c.flux.element_sum());
    let toward = cells.iter().map(weighted).sum::<DVec3>();
    let solid_angle: f64 = cells.iter().map(|c| f64::from(c.solid_angle)).sum();
    SunEmitter {
        toward_world: toward.try_normalize().map_or(cells[0].direction, |toward| toward.as_vec3()),
        irradiance: Irradiance(flux(cells).as_vec3()),
        sin_radius: (solid_angle / std::f64::consts::PI).sqrt().min(1.0) as f32,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bright_spot_becomes_a_sun_and_no_energy_is_lost() {
        let [w, h] = [64u32, 32u32];
        let mut pixels = vec![Vec3::ONE; (w * h) as usize];
        pixels[(8 * w + 40) as usize] = Vec3::splat(5000.0);
        let image = SkyImage::new([w, h], pixels).unwrap();
        let (suns, rest) = split(&Sky::Image(image));
        assert_eq!(suns.len(), 1);
        let (u, v) = (40.5 / 64.0, 8.5 / 32.0);
        let toward = SkyImage::direction_world(u, v);
        assert!(suns[0].toward_world.dot(toward) > 0.9999);
        let Sky::Image(rest) = rest else { panic!("the rest is an image") };
        let omega = ((PI * 8.0 / 32.0).cos() - (PI * 9.0 / 32.0).cos()) * 2.0 * PI / 64.0;
        let taken = 5000.0 - rest.pixel(40, 8).mean();
        assert!((suns[0].irradiance.mean() - taken * omega).abs() < 1e-3 * taken * omega);
    }

    #[test]
    fn the_sun_of_millions_of_pixels_has_all_their_light() {
        let cell = || Cell { direction: Vec3::Y, flux: Vec3::splat(0.1), solid_angle: 1e-8 };
        let cells: Vec<Cell> = std::iter::repeat_with(cell).take(1 << 22).collect();
        let expected = f64::from(0.1_f32) * f64::from(1 << 22);
        let found = f64::from(sun(&cells).irradiance.mean());
        // Only the result is rounded to f32.
        assert!((found / expected - 1.0).abs() < 2e-7, "{found} instead of {expected}");
    }
}
