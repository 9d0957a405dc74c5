//! Patches, and the same bytes for any number of threads.

use crate::elements::patches::{MOST, patches_within};
use crate::elements::testing::{Piece, Stand};
use crate::elements::{Patches, patches};
use crate::scene::MaterialId;
use glam::{DAffine3, DVec3, Vec2, Vec3};

/// A room's floor, a curved vault and a crowd of small boxes.
fn crowd(boxes: u32) -> Stand {
    let mut stand = Stand::new(1024);
    let floor = Piece::rectangle(Vec3::ZERO, Vec3::Z * 8.0, Vec3::X * 8.0, 2, Vec2::splat(2.0), 0.04);
    stand.add(floor, DAffine3::IDENTITY, MaterialId(0));
    let mut vault =
        Piece::rectangle(Vec3::ZERO, Vec3::X * 8.0, Vec3::Z * 8.0, 16, Vec2::new(220.0, 2.0), 0.04);
    vault.position.iter_mut().for_each(|p| p.y = 3.0 + 3.0 * (p.x * 0.39).sin());
    vault.normal = vault.flat_normals();
    stand.add(vault, DAffine3::IDENTITY, MaterialId(0));
    for i in 0..boxes {
        let (column, row) = (i % 16, i / 16);
        let at = Vec2::new(2.0 + 60.0 * column as f32, 220.0 + 9.0 * row as f32);
        let cube = Piece::closed_box(Vec3::ZERO, Vec3::splat(0.2), at, 9.0, 0.04);
        let place = DVec3::new(f64::from(column) * 0.45 + 0.2, 0.0, f64::from(row) * 0.3 + 0.2);
        stand.add(cube, DAffine3::from_translation(place), MaterialId(0));
    }
    stand
}

fn assert_partition(stand: &Stand, wanted: u32) -> Patches {
    assert_partition_within(stand, wanted, MOST)
}

fn assert_partition_within(stand: &Stand, wanted: u32, most: usize) -> Patches {
    let elements = stand.elements();
    let patches = patches_within(&elements, wanted, most, |_| true);
    assert_eq!(patches.first.len(), patches.len() + 1);
    let mut seen = vec![false; elements.len()];
    for patch in 0..patches.len() as u32 {
        let members = patches.elements_of(patch);
        assert!(!members.is_empty());
        let area: f64 = members.iter().map(|&e| f64::from(elements.area[e as usize].0)).sum();
        assert!((area - patches.area[patch as usize]).abs() < 1e-9 * area && area > 0.0);
        for &e in members {
            assert!(!std::mem::replace(&mut seen[e as usize], true));
            assert!(elements.valid[e as usize]);
            assert_eq!(patches.patch_of_element[e as usize], patch);
        }
        assert!(patches.position_world[patch as usize].is_finite());
        assert!((patches.reflectance[patch as usize].mean() - elements.reflectance[0].mean()).abs() < 1e-5);
    }
    for (e, seen) in seen.iter().enumerate() {
        assert_eq!(*seen, elements.valid[e] && elements.area[e].0 > 0.0, "{e}");
        assert!((patches.patch_of_element[e] as usize) < patches.len());
    }
    let firsts: Vec<u32> =
        (0..patches.len() as u32).map(|p| *patches.elements_of(p).iter().min().unwrap()).collect();
    assert!(firsts.is_sorted());
    patches
}

#[test]
fn patches_are_a_partition_near_the_wanted_number() {
    let stand = crowd(40);
    for wanted in [500, 2000, 5000] {
        let patches = assert_partition(&stand, wanted);
        let count = patches.len();
        assert!(count > wanted as usize / 2 && count <= 2 * wanted as usize, "{count} of {wanted}");
        let total: f64 = patches.area.iter().sum();
        let largest = patches.area.iter().copied().fold(0.0, f64::max);
        assert!(largest < 6.0 * total / f64::from(wanted), "{largest} of {total} / {wanted}");
    }
}

#[test]
fn curved_patches_do_not_turn_far() {
    let stand = crowd(0);
    let patches = assert_partition(&stand, 16);
    assert!(patches.normal_world.iter().all(|n| n.length() > 0.88), "{:?}", patches.normal_world);
}

#[test]
fn many_charts_share_patches() {
    // 300 boxes of five visible faces, 24 m² of boxes beside 150 m² of room.
    let stand = crowd(300);
    for wanted in [1, 10, 100, 1000] {
        let count = assert_partition_within(&stand, wanted, 0).len();
        assert!(count <= 2 * wanted as usize + 1, "{count} of {wanted}");
    }
}

#[test]
fn charts_share_no_patch_while_they_are_few() {
    let stand = crowd(300);
    let elements = stand.elements();
    let patches = patches(&elements, 10, |_| true);
    for patch in 0..patches.len() as u32 {
        let charts: Vec<u32> =
            patches.elements_of(patch).iter().map(|&e| elements.chart[e as usize]).collect();
        assert!(charts.iter().all(|&c| c == charts[0]), "patch {patch} joins charts");
    }
}

#[test]
fn no_elements_no_patches() {
    let stand = Stand::new(64);
    let patches = assert_partition(&stand, 100);
    assert!(patches.is_empty());
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let stand = crowd(60);
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let elements = stand.elements();
            let patches = patches(&elements, 700, |_| true);
            (elements, patches)
        })
    };
    let (one, one_patches) = run(1);
    for threads in [2, 7] {
        let (other, other_patches) = run(threads);
        assert_eq!(one, other);
        assert_eq!(one_patches, other_patches);
    }
}
