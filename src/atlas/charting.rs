//! Geometry -> charts. A region between hard edges that is a plane is its own exact chart (what xatlas makes of it,
//! at once); curved ones go to xatlas; those too large for it to uvunwrap; those too large for that, and whatever
//! comes back bad, are cut into normal cones and projected. A triangle alone is the last resort and always works.

use super::check::{Fault, check};
use super::flat::{RawChart, cones, lone, plane};
use super::topology::Topology;
use super::xatlas::{FlatChart, NoCharts, Piece};
use super::{second, weave, xatlas};
use crate::error::{Error, Result, Warning};
use crate::progress::Progress;
use crate::scene::Geometry;
use glam::DVec3;
use rayon::prelude::*;
use std::time::{Duration, Instant};

/// Largest curved region, triangles, that xatlas is asked for: it tests every growing chart against itself.
const XATLAS_LIMIT: usize = 1000;
/// Largest that uvunwrap is asked for.
const SECOND_LIMIT: usize = 50_000;
/// Seconds that xatlas needs for n² triangles² and uvunwrap for n triangles, measured on two cores.
const XATLAS_SECONDS: f64 = 5e-8;
const SECOND_SECONDS: f64 = 3e-5;
/// Predicted seconds of the whole scene; where they would not do, the largest regions are cut into cones instead.
/// Predicted, not measured, so that the result is the same on every machine.
const BUDGET_SECONDS: f64 = 6.0;
/// The last resort: a region that takes this long is given up. Only here the result depends on the machine's speed, so
/// it is a hundred times what the limits above allow.
const PATIENCE: Duration = Duration::from_secs(300);
/// xatlas and uvunwrap get pieces whose mean triangle has an area of a half. They are not asked to deal with
/// triangles smaller than this, nor with pieces that have longer edges: f32 and their absolute tolerances fail there.
const CRUMB_AREA: f64 = 1e-6;
const LONG_EDGE: f32 = 3000.0;
/// More charts per triangle than this, beyond a few, and a region was cut to shreds.
const SHREDS: usize = 4;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Method {
    Xatlas,
    Second,
    Cones,
}

/// A geometry on its way.
struct Draft<'a> {
    geometry: &'a Geometry,
    topology: Topology,
    charts: Vec<RawChart>,
    curved: Vec<Vec<u32>>,
    log: Log,
}

/// What is worth telling about one geometry.
#[derive(Clone, Copy, Default)]
struct Log {
    second: usize,
    cones: usize,
    late: usize,
    failed: usize,
    turned: usize,
    stretched: usize,
    overlapping: usize,
    shredded: usize,
}

/// Charts of every geometry that is asked for; `None` for the others and for those without any area. Advances by one
/// per geometry.
pub(super) fn charts(
    geometries: &[Geometry],
    wanted: &[bool],
    progress: &Progress,
    warnings: &mut Vec<Warning>,
) -> Result<Vec<Option<weave::Woven>>> {
    let stop = || if progress.cancelled() { Err(Error::Cancelled) } else { Ok(()) };
    let drafts: Vec<Option<Draft>> = geometries
        .par_iter()
        .zip(wanted)
        .map(|(geometry, &wanted)| {
            stop()?;
            Ok(wanted.then(|| Draft::of(geometry)))
        })
        .collect::<Result<_>>()?;
    let flattened = flatten(&drafts, progress);
    stop()?;
    let results: Vec<Option<(Option<weave::Woven>, Vec<Warning>)>> = drafts
        .into_par_iter()
        .zip(flattened)
        .map(|(draft, flattened)| {
            stop()?;
            let result = draft.map(|draft| draft.finish(flattened));
            progress.advance(1);
            Ok(result)
        })
        .collect::<Result<_>>()?;
    let mut woven = Vec::with_capacity(results.len());
    for result in results {
        let (charts, told) = result.unwrap_or_default();
        warnings.extend(told);
        woven.push(charts);
    }
    Ok(woven)
}

type Flattened = (Method, std::result::Result<Vec<FlatChart>, NoCharts>);

/// Sends all curved regions of the scene to their methods, the dearest first.
fn flatten(drafts: &[Option<Draft>], progress: &Progress) -> Vec<Vec<Flattened>> {
    let mut jobs: Vec<(usize, usize)> = Vec::new();
    for (d, draft) in drafts.iter().enumerate() {
        jobs.extend((0..draft.as_ref().map_or(0, |draft| draft.curved.len())).map(|r| (d, r)));
    }
    let size = |&(d, r): &(usize, usize)| drafts[d].as_ref().map_or(0, |draft| draft.curved[r].len());
    jobs.sort_by_key(|job| (size(job), *job));
    let mut seconds = 0.0;
    let mut methods: Vec<Method> = Vec::with_capacity(jobs.len());
    for job in &jobs {
        let n = size(job);
        let (method, cost) = if n <= XATLAS_LIMIT {
            (Method::Xatlas, XATLAS_SECONDS * (n * n) as f64)
        } else if n <= SECOND_LIMIT {
            (Method::Second, SECOND_SECONDS * n as f64)
        } else {
            (Method::Cones, 0.0)
        };
        let dear = seconds + cost > BUDGET_SECONDS;
        seconds += cost;
        methods.push(if dear { Method::Cones } else { method });
    }
    // From the large end: what takes longest begins first.
    let mut done: Vec<((usize, usize), Flattened)> = jobs
        .into_par_iter()
        .zip(methods)
        .rev()
        .with_max_len(1)
        .map(|((d, r), method)| {
            let found = match &drafts[d] {
                Some(draft) => draft.ask(method, r, progress),
                None => Err(NoCharts::Failed),
            };
            ((d, r), (method, found))
        })
        .collect();
    done.sort_by_key(|&(job, _)| job);
    let mut results: Vec<Vec<Flattened>> = drafts.iter().map(|_| Vec::new()).collect();
    for ((d, _), result) in done {
        results[d].push(result);
    }
    results
}

impl<'a> Draft<'a> {
    fn of(geometry: &'a Geometry) -> Self {
        let mut topology = Topology::of(geometry);
        let (mut charts, mut curved) = (Vec::new(), Vec::new());
        let mut log = Log::default();
        for region in std::mem::take(&mut topology.regions) {
            let flat = plane(geometry, &topology, &region).map(|mut chart| {
                let verdict = check(geometry, &topology, &mut chart);
                (chart, verdict)
            });
            match flat {
                Some((chart, Ok(()))) => charts.push(chart),
                // Planes that wind over themselves.
                Some((_, Err(fault))) => {
                    log.note(fault);
                    safe_cones(geometry, &topology, &region, &mut charts);
                }
                None => curved.push(region),
            }
        }
        Self { geometry, topology, charts, curved, log }
    }

    fn ask(
        &self,
        method: Method,
        region: usize,
        progress: &Progress,
    ) -> std::result::Result<Vec<FlatChart>, NoCharts> {
        let begin = Instant::now();
        let go_on = || !progress.cancelled() && begin.elapsed() < PATIENCE;
        let ask = match method {
            Method::Xatlas => xatlas::charts,
            Method::Second => second::charts,
            Method::Cones => return Err(NoCharts::Failed),
        };
        let (piece, rows) = self.piece(&self.curved[region]);
        let edge = |t: &[u32; 3], k: usize| {
            piece.position[t[k] as usize].distance(piece.position[t[(k + 1) % 3] as usize])
        };
        if piece.triangles.iter().any(|t| (0..3).any(|k| edge(t, k) > LONG_EDGE)) {
            return Err(NoCharts::Failed);
        }
        let mut charts = ask(&piece, &go_on)?;
        charts.iter_mut().flat_map(|chart| &mut chart.triangles).for_each(|t| *t = rows[*t as usize]);
        Ok(charts)
    }

    /// The region alone, moved to the origin and scaled to a mean triangle area of a half, without its crumbs; and
    /// which triangle of the region each of the piece is.
    fn piece(&self, region: &[u32]) -> (Piece, Vec<u32>) {
        let area: f64 = region.iter().map(|&t| self.topology.area[t as usize]).sum();
        let scale = (0.5 * region.len() as f64 / area).sqrt();
        let sound = |t: u32| self.topology.area[t as usize] * scale * scale >= CRUMB_AREA;
        let rows: Vec<u32> = (0..region.len() as u32).filter(|&row| sound(region[row as usize])).collect();
        let triangles: Vec<u32> = rows.iter().map(|&row| region[row as usize]).collect();
        let point = |i: u32| self.geometry.position_local[i as usize].as_dvec3();
        let mut corners: Vec<u32> =
            triangles.iter().flat_map(|&t| self.geometry.triangles[t as usize]).collect();
        corners.sort_unstable();
        corners.dedup();
        let (low, high) = corners.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), &i| {
            (low.min(point(i)), high.max(point(i)))
        });
        let middle = (low + high) * 0.5;
        let row = |i: u32| corners.partition_point(|&c| c < i) as u32;
        let normal = |i: u32| self.geometry.normal_local.get(i as usize).copied().filter(|n| n.is_finite());
        let piece = Piece {
            position: corners.iter().map(|&i| ((point(i) - middle) * scale).as_vec3()).collect(),
            normal: corners.iter().map(|&i| normal(i).unwrap_or_default()).collect(),
            triangles: triangles.iter().map(|&t| self.geometry.triangles[t as usize].map(row)).collect(),
        };
        (piece, rows)
    }

    fn finish(mut self, flattened: Vec<Flattened>) -> (Option<weave::Woven>, Vec<Warning>) {
        for (region, (method, found)) in std::mem::take(&mut self.curved).iter().zip(flattened) {
            self.take(region, method, found);
        }
        let woven = weave::weave(self.geometry, &self.topology, self.charts);
        let mut warnings = self.log.tell(self.geometry);
        match &woven {
            None => warnings
                .push(Warning::new(&self.geometry.name, "has no triangle with an area: it gets no lightmap")),
            Some(woven) => {
                let (charts, triangles) = (woven.charts.len(), self.geometry.triangles.len());
                if charts > 1000 && charts * 3 > triangles {
                    let what = format!(
                        "falls into {charts} charts for {triangles} triangles, because few of its triangles share an \
                         edge smoothly; much of its texture space goes into gutters. Merge its vertices if it should \
                         be one surface"
                    );
                    warnings.push(Warning::new(&self.geometry.name, what));
                }
            }
        }
        (woven, warnings)
    }

    /// Keeps the good charts of a region; cuts the rest of it into cones.
    fn take(&mut self, region: &[u32], method: Method, found: std::result::Result<Vec<FlatChart>, NoCharts>) {
        let (geometry, topology) = (self.geometry, &self.topology);
        match (method, &found) {
            (Method::Second, _) => self.log.second += 1,
            (Method::Cones, _) => self.log.cones += 1,
            _ => {}
        }
        match found {
            Err(NoCharts::Stopped) => self.log.late += 1,
            Err(NoCharts::Failed) if method != Method::Cones => self.log.failed += 1,
            _ => {}
        }
        let mut flat = found.unwrap_or_default();
        if flat.len() > SHREDS + region.len() / SHREDS {
            let mut cut = Vec::new();
            safe_cones(geometry, topology, region, &mut cut);
            if cut.len() < flat.len() {
                self.log.shredded += usize::from(cut.len() * 2 < flat.len());
                self.charts.extend(cut);
                return;
            }
        }
        let mut left: Vec<bool> = vec![true; region.len()];
        for chart in &mut flat {
            chart.triangles.iter().for_each(|&t| left[t as usize] = false);
            let triangles = chart.triangles.iter().map(|&t| region[t as usize]).collect();
            let mut chart = RawChart { triangles, corner_uv: std::mem::take(&mut chart.corner_uv) };
            match check(geometry, topology, &mut chart) {
                Ok(()) => self.charts.push(chart),
                Err(fault) => {
                    self.log.note(fault);
                    safe_cones(geometry, topology, &chart.triangles, &mut self.charts);
                }
            }
        }
        let rest: Vec<u32> = region.iter().zip(left).filter(|&(_, left)| left).map(|(&t, _)| t).collect();
        if !rest.is_empty() {
            safe_cones(geometry, topology, &rest, &mut self.charts);
        }
    }
}

/// Cones that are narrowed until their projections are sound, down to single triangles.
fn safe_cones(geometry: &Geometry, topology: &Topology, triangles: &[u32], out: &mut Vec<RawChart>) {
    let mut todo: Vec<Vec<u32>> = vec![triangles.to_vec()];
    for narrow in [0.0, 0.6, 0.98] {
        let mut bad = Vec::new();
        for group in todo {
            for mut chart in cones(geometry, topology, &group, narrow) {
                match check(geometry, topology, &mut chart) {
                    Ok(()) => out.push(chart),
                    Err(_) => bad.push(chart.triangles),
                }
            }
        }
        todo = bad;
    }
    out.extend(todo.into_iter().flatten().map(|t| lone(geometry, topology, t)));
}

impl Log {
    fn note(&mut self, fault: Fault) {
        match fault {
            Fault::NotFinite => self.failed += 1,
            Fault::Turned => self.turned += 1,
            Fault::Stretched => self.stretched += 1,
            Fault::Overlaps => self.overlapping += 1,
        }
    }

    fn tell(&self, geometry: &Geometry) -> Vec<Warning> {
        let bad = [
            (self.failed, "failed"),
            (self.turned, "turned triangles over"),
            (self.stretched, "were stretched too far"),
            (self.overlapping, "covered themselves"),
            (self.shredded, "fell to pieces"),
        ];
        let bad: Vec<String> =
            bad.iter().filter(|&&(n, _)| n > 0).map(|(n, what)| format!("{n} {what}")).collect();
        let mut told = Vec::new();
        if self.second > 0 {
            told.push(format!(
                "{} smooth part(s) of more than {XATLAS_LIMIT} triangles were unwrapped by uvunwrap, because xatlas \
                 would take long",
                self.second
            ));
        }
        if self.cones > 0 {
            told.push(format!(
                "{} smooth part(s) were cut into flat pieces by their normals, because unwrapping them with less \
                 seams would take long",
                self.cones
            ));
        }
        if self.late > 0 {
            told.push(format!(
                "{} part(s) were given up after {} seconds and cut into flat pieces by their normals; on another \
                 machine they may come out differently",
                self.late,
                PATIENCE.as_secs()
            ));
        }
        if !bad.is_empty() {
            told.push(format!(
                "some charts could not be used ({}) and were cut into flat pieces by their normals",
                bad.join(", ")
            ));
        }
        told.into_iter().map(|what| Warning::new(&geometry.name, what)).collect()
    }
}
