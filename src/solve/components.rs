//! Rooms that see nothing of each other.

use super::Rgb;
use super::problem::Problem;
use super::rows::{RowSource, Rows};

/// The patches in sets between which no form factor leads, with what the ambient term needs of each.
#[derive(Clone, Debug)]
pub(super) struct Components {
    /// Set of each patch.
    pub of: Vec<u32>,
    sets: Vec<Set>,
    /// Whether rows are still to be learned from.
    learning: bool,
}

#[derive(Clone, Debug, Default)]
struct Set {
    area: f64,
    /// Σ A ρ.
    reflecting: Rgb,
    /// Area that was looked at for how much of its power arrives, and A times that share.
    known: f64,
    arriving: f64,
    /// Ambient irradiance per watt of unshot power, 1/m².
    ambient_per_watt: Rgb,
}

impl Components {
    /// The connected sets of the graph of form factors.
    pub fn of_rows(problem: &Problem<Rows>) -> Self {
        let rows = problem.rows();
        let mut parent: Vec<u32> = (0..rows.len() as u32).collect();
        for patch in 0..rows.len() {
            let (column, weight) = rows.patch(patch);
            for (&other, &weight) in column.iter().zip(weight) {
                if weight > 0.0 {
                    let (a, b) = (root(&mut parent, patch as u32), root(&mut parent, other));
                    parent[a.max(b) as usize] = a.min(b);
                }
            }
        }
        let mut of = vec![0; rows.len()];
        let mut count = 0;
        for patch in 0..rows.len() {
            let root = root(&mut parent, patch as u32) as usize;
            // A root is the lowest of its set, so it has been numbered before.
            of[patch] = if root == patch { count } else { of[root] };
            count += u32::from(root == patch);
        }
        let mut components = Self::new(problem, of, count as usize);
        for patch in 0..rows.len() {
            let set = &mut components.sets[components.of[patch] as usize];
            set.known += problem.area()[patch];
            set.arriving += problem.area()[patch] * rows.sum(patch);
        }
        components.sets.iter_mut().for_each(Set::estimate);
        components.learning = false;
        components
    }

    /// All patches in one set, of which nothing is known yet: where rows are not kept.
    pub fn single<R: RowSource>(problem: &Problem<R>) -> Self {
        Self::new(problem, vec![0; problem.len()], 1)
    }

    fn new<R: RowSource>(problem: &Problem<R>, of: Vec<u32>, count: usize) -> Self {
        let mut sets = vec![Set::default(); count];
        for (patch, &set) in of.iter().enumerate() {
            let (set, area) = (&mut sets[set as usize], problem.area()[patch]);
            set.area += area;
            set.reflecting += problem.reflectance()[patch] * area;
        }
        Self { of, sets, learning: true }
    }

    /// A patch of this `area` was seen to send the share `arriving` of its power to other patches.
    pub fn observe(&mut self, patch: usize, area: f64, arriving: f64) {
        if !self.learning {
            return;
        }
        let set = &mut self.sets[self.of[patch] as usize];
        set.known += area;
        set.arriving += area * arriving;
        set.estimate();
    }

    /// The mean irradiance that the signed power `unshot` (W) of a set will still cause, W/m².
    pub fn ambient(&self, set: usize, unshot: Rgb) -> Rgb {
        unshot * self.sets[set].ambient_per_watt
    }

    /// Number of sets.
    pub fn count(&self) -> usize {
        self.sets.len()
    }
}

impl Set {
    /// Of the mean unshot radiosity u a share c arrives somewhere in the set, of which a share ρ̄ is reflected, and so
    /// on: E = c u (1 + c ρ̄ + …) = c u / (1 − c ρ̄).
    fn estimate(&mut self) {
        let closed = if self.known > 0.0 { (self.arriving / self.known).min(1.0) } else { 0.0 };
        // Reflectances of 1 have their place where much escapes; the few rows known may not show it.
        let absorbed = (self.area - self.reflecting * closed).max(Rgb::splat(1e-3 * self.area));
        self.ambient_per_watt = closed / absorbed;
    }
}

fn root(parent: &mut [u32], mut patch: u32) -> u32 {
    while parent[patch as usize] != patch {
        let grandparent = parent[parent[patch as usize] as usize];
        parent[patch as usize] = grandparent;
        patch = grandparent;
    }
    patch
}
