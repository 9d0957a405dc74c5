//! Sealed rooms: what is inside a closed opaque shell and what is outside see nothing of each other.
//!
//! A closed surface parts space by its winding number: to get from a point it winds around w times to one it winds
//! around w' ≠ w times, a path has to cross it. So two things can exchange light only where they have the same
//! winding numbers in all opaque shells. A thing that touches a shell from one side has one winding number; one that
//! pierces it counts to all sides.

use super::bodies::{Bodies, Placed};
use super::columns::{Columns, Place};
use super::solid::{Skin, volume_and_area};
use crate::scene::{LampKind, Opacity, Role, Scene};
use glam::{DAffine3, DVec3};
use std::collections::{BTreeMap, HashMap};

/// The largest closed shells that are looked at.
const MOST_SHELLS: usize = 256;
/// The most pairs of triangles that are tested for crossing, all shells together.
const MOST_PAIRS: u64 = 20_000_000;
/// The most triangle tests that finding the sides of a shell may take.
const MOST_TESTS: f64 = 1e8;
/// Beyond these coordinates triangles are not met by rays, metres.
const FARTHEST: f64 = 1e15;

/// Which sides of which surfaces, and which lamps, are in which sealed room. Room 0 is the outside, where sky and
/// suns are; things that pierce a shell are in several.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Rooms {
    /// Per surface the rooms of its front and of its back, ascending.
    pub of_side: Vec<[Vec<u32>; 2]>,
    /// Per lamp, ascending; suns are outside.
    pub of_lamp: Vec<Vec<u32>>,
    /// Per room the object that closes it; empty for the outside.
    pub names: Vec<String>,
}

/// Whether two ascending lists share an entry.
pub fn meet(a: &[u32], b: &[u32]) -> bool {
    a.iter().any(|room| b.binary_search(room).is_ok())
}

/// A closed opaque component around which others are asked to be inside or outside.
struct Shell {
    item: usize,
    columns: Columns,
    shape_from_world: DAffine3,
    /// Winding numbers just in front of, and just behind, its triangles.
    own: [Vec<i32>; 2],
}

/// Winding numbers in each shell that is not simply outside; `None` is any.
type Pattern = BTreeMap<usize, Option<Vec<i32>>>;
/// The same of one point, zeros left out.
type Key = Vec<(usize, i32)>;

impl Rooms {
    /// The room where the sky is.
    pub const OUTSIDE: u32 = 0;

    /// Everything in one room.
    pub fn one(scene: &Scene) -> Self {
        Self {
            of_side: vec![[vec![Rooms::OUTSIDE], vec![Rooms::OUTSIDE]]; scene.surfaces.len()],
            of_lamp: vec![vec![Rooms::OUTSIDE]; scene.lamps.len()],
            names: vec![String::new()],
        }
    }

    /// Number of rooms, the outside included.
    pub fn len(&self) -> usize {
        self.names.len()
    }

    /// Never true: there is always an outside.
    pub fn is_empty(&self) -> bool {
        self.names.is_empty()
    }
}

/// Finds the rooms of a scene.
pub(super) fn rooms(scene: &Scene, bodies: &Bodies) -> Rooms {
    let shells = shells(scene, bodies);
    if shells.is_empty() {
        return Rooms::one(scene);
    }
    let items = bodies.placed.len();
    let mut patterns: Vec<[Pattern; 2]> = vec![Default::default(); items];
    let mut pairs = MOST_PAIRS;
    for (s, shell) in shells.iter().enumerate() {
        for item in bodies.order.overlapping(&bodies.placed, shell.item) {
            let winding = shell.winding_of(scene, bodies, item, &mut pairs);
            if winding.as_deref() != Some(&[0]) {
                patterns[item].iter_mut().for_each(|side| drop(side.insert(s, winding.clone())));
            }
        }
        for (pattern, own) in patterns[shell.item].iter_mut().zip(&shell.own) {
            pattern.insert(s, Some(own.clone()));
        }
    }
    let lamps: Vec<Pattern> = scene.lamps.iter().map(|lamp| lamp_pattern(&lamp.kind, &shells)).collect();

    let mut known: HashMap<Key, u32> = HashMap::from([(Key::new(), Rooms::OUTSIDE)]);
    let mut keys = vec![Key::new()];
    for pattern in patterns.iter().flatten().chain(&lamps) {
        for key in certain(pattern) {
            known.entry(key).or_insert_with_key(|key| {
                keys.push(key.clone());
                keys.len() as u32 - 1
            });
        }
    }
    let of = |pattern: &Pattern| -> Vec<u32> {
        (0..).zip(&keys).filter(|(_, key)| matches(pattern, key)).map(|(room, _)| room).collect()
    };
    let mut of_side: Vec<[Vec<u32>; 2]> = vec![Default::default(); scene.surfaces.len()];
    for (item, sides) in patterns.iter().enumerate() {
        let rooms = [of(&sides[0]), of(&sides[1])];
        for surface in bodies.surfaces(item) {
            for side in 0..2 {
                of_side[surface as usize][side].extend(&rooms[side]);
            }
        }
    }
    for rooms in of_side.iter_mut().flatten() {
        // A surface of no triangles, or of such that weld to nothing, is nowhere: it counts to everywhere.
        if rooms.is_empty() {
            rooms.extend(0..keys.len() as u32);
        }
        rooms.sort_unstable();
        rooms.dedup();
    }
    Rooms {
        of_side,
        of_lamp: lamps.iter().map(of).collect(),
        names: keys.iter().map(|key| name(scene, bodies, &shells, key)).collect(),
    }
}

/// The keys a pattern stands for where it is certain.
fn certain(pattern: &Pattern) -> Vec<Key> {
    let mut keys = vec![Key::new()];
    for (&shell, windings) in pattern {
        let Some(windings) = windings.as_ref().filter(|w| w.len() * keys.len() <= 16) else {
            return Vec::new();
        };
        let longer = |key: &Key| {
            let key = key.clone();
            windings.iter().map(move |&w| {
                let mut key = key.clone();
                key.extend((w != 0).then_some((shell, w)));
                key
            })
        };
        keys = keys.iter().flat_map(longer).collect();
    }
    keys
}

fn matches(pattern: &Pattern, key: &Key) -> bool {
    let winding = |shell: usize| key.iter().find(|(s, _)| *s == shell).map_or(0, |(_, w)| *w);
    key.iter().all(|(shell, _)| pattern.contains_key(shell))
        && pattern.iter().all(|(&shell, windings)| {
            windings.as_ref().is_none_or(|windings| windings.contains(&winding(shell)))
        })
}

/// The innermost shell of a room.
fn name(scene: &Scene, bodies: &Bodies, shells: &[Shell], key: &Key) -> String {
    let size = |shell: usize| {
        let placed = &bodies.placed[shells[shell].item];
        placed.min.distance(placed.max)
    };
    let innermost = key.iter().map(|(shell, _)| *shell).min_by(|&a, &b| size(a).total_cmp(&size(b)));
    let surface = innermost.and_then(|shell| bodies.surfaces(shells[shell].item).first().copied());
    surface.map_or(String::new(), |surface| scene.surfaces[surface as usize].origin.name.clone())
}

/// Closed opaque components that may have something inside, the largest where there are too many.
fn shells(scene: &Scene, bodies: &Bodies) -> Vec<Shell> {
    let placed = &bodies.placed;
    let mut candidates: Vec<usize> = (0..placed.len())
        .filter(|&item| {
            let component = bodies.component(item);
            !matches!(component.skin, Skin::Open | Skin::Tangled)
                && has_something_inside(scene, bodies, item)
                && blocks_all_light(scene, bodies, item)
        })
        .collect();
    let size = |item: usize| placed[item].min.distance(placed[item].max);
    candidates.sort_by(|&a, &b| size(b).total_cmp(&size(a)).then(a.cmp(&b)));
    candidates.truncate(MOST_SHELLS);
    candidates.sort_unstable();
    candidates.into_iter().filter_map(|item| Shell::new(bodies, item)).collect()
}

/// Whether something might be inside, as far as boxes tell, or it faces inward itself.
fn has_something_inside(scene: &Scene, bodies: &Bodies, item: usize) -> bool {
    let Placed { min, max, .. } = bodies.placed[item];
    if volume_and_area(bodies.component(item).corners.iter().copied()).0 < 0.0 {
        return true;
    }
    let slack = DVec3::splat(1e-5 * min.distance(max));
    let holds = |a: DVec3, b: DVec3| a.cmpge(min - slack).all() && b.cmple(max + slack).all();
    let lamp_inside = scene.lamps.iter().any(|lamp| match lamp.kind {
        LampKind::Point { position_world, .. } => holds(position_world.as_dvec3(), position_world.as_dvec3()),
        LampKind::Sun { .. } => false,
    });
    let glows = |surface: u32| {
        let surface = &scene.surfaces[surface as usize];
        scene.material(surface).double_sided && scene.emits(surface)
    };
    lamp_inside
        || bodies.surfaces(item).into_iter().any(glows)
        || bodies
            .order
            .overlapping(&bodies.placed, item)
            .any(|other| holds(bodies.placed[other].min, bodies.placed[other].max))
}

/// Whether no ray gets through: opaque everywhere, and every triangle is one that rays meet.
fn blocks_all_light(scene: &Scene, bodies: &Bodies, item: usize) -> bool {
    let opaque = |surface: u32| {
        let surface = &scene.surfaces[surface as usize];
        surface.role != Role::Emits
            && scene.material(surface).transmission <= 0.0
            && scene.opacity_of(surface) == Opacity::Full
    };
    let met = |(surface, triangle): (u32, u32)| {
        let [a, b, c] =
            scene.corners_world(&scene.surfaces[surface as usize], triangle).map(|corner| corner.as_dvec3());
        let area = (b - a).cross(c - a).length();
        area > 0.0 && [a, b, c].iter().all(|corner| corner.abs().max_element() <= FARTHEST)
    };
    bodies.surfaces(item).into_iter().all(opaque) && bodies.triangles(item).all(met)
}

impl Shell {
    fn new(bodies: &Bodies, item: usize) -> Option<Self> {
        let frame = bodies.bodies[bodies.placed[item].body].world_from_shape;
        let linear = frame.matrix3;
        let cube = linear.x_axis.length() * linear.y_axis.length() * linear.z_axis.length();
        let volume = linear.determinant().abs();
        if volume.is_nan() || volume <= 1e-9 * cube {
            return None;
        }
        let corners = &bodies.component(item).corners;
        let mut ids = HashMap::new();
        let id = |corner: DVec3, ids: &mut HashMap<[u64; 3], u32>| {
            let next = ids.len() as u32;
            *ids.entry((corner + DVec3::ZERO).to_array().map(f64::to_bits)).or_insert(next)
        };
        let named = corners.iter().map(|t| t.map(|corner| id(corner, &mut ids))).collect();
        let columns = Columns::of(corners.clone(), named);
        if columns.cost() * 2.0 * corners.len() as f64 > MOST_TESTS {
            return None;
        }
        let mut own = [Vec::new(), Vec::new()];
        for &[a, b, c] in corners {
            let cross = (b - a).cross(c - a);
            let longest = (b - a).length().max((c - b).length()).max((a - c).length());
            let step = cross.try_normalize()? * (1e-4 * cross.length() / longest);
            let middle = (a + b + c) / 3.0;
            own[0].push(columns.winding(middle + step));
            own[1].push(columns.winding(middle - step));
        }
        for side in &mut own {
            side.sort_unstable();
            side.dedup();
        }
        Some(Self { item, columns, shape_from_world: frame.inverse(), own })
    }

    /// How often the shell winds around a component; `None` where it crosses the shell, or nobody can tell.
    fn winding_of(&self, scene: &Scene, bodies: &Bodies, item: usize, pairs: &mut u64) -> Option<Vec<i32>> {
        let mut samples = Vec::new();
        for (surface, triangle) in bodies.triangles(item) {
            let corners = scene.corners_world(&scene.surfaces[surface as usize], triangle);
            let [a, b, c] = corners.map(|corner| self.shape_from_world.transform_point3(corner.as_dvec3()));
            if samples.len() < 64 {
                samples.extend([(a + b + c) / 3.0, a, b, c]);
            }
            for other in self.columns.near(a.min(b).min(c), a.max(b).max(c)) {
                *pairs = pairs.checked_sub(1)?;
                if self.columns.crosses(other, &[a, b, c]) {
                    return None;
                }
            }
        }
        let sure = samples.into_iter().find(|&sample| self.columns.place(sample) != Place::On)?;
        Some(vec![self.columns.winding(sure)])
    }
}

fn lamp_pattern(kind: &LampKind, shells: &[Shell]) -> Pattern {
    let LampKind::Point { position_world, radius_m, .. } = *kind else { return Pattern::new() };
    let mut pattern = Pattern::new();
    for (s, shell) in shells.iter().enumerate() {
        let at = shell.shape_from_world.transform_point3(position_world.as_dvec3());
        let linear = shell.shape_from_world.matrix3;
        let widest = linear.x_axis.length().max(linear.y_axis.length()).max(linear.z_axis.length());
        // The spectral norm is at most √3 times the longest column.
        let reach = f64::from(radius_m.max(0.0)) * widest * 3f64.sqrt();
        let winding = shell.columns.winding(at);
        let close = shell.columns.place(at) == Place::On || shell.columns.is_near(at, reach);
        if close {
            pattern.insert(s, None);
        } else if winding != 0 {
            pattern.insert(s, Some(vec![winding]));
        }
    }
    pattern
}
