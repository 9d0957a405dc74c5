//! Is a baked file as it should be? Whether its light is there and agrees about its unit, whether its texture space is
//! in range, without overlap and with gaps, how dense it is, and whether the light has faults that can be found without
//! knowing the answer: values that are no light, steps at seams, fronts that are dark while backs are lit.

mod density;
mod flipped;
mod layout;
mod pages;
mod picture;
mod seams;
mod statements;

pub use density::Density;
pub use picture::density_picture;
pub use seams::Seams;

use crate::baked::Baked;
use crate::render::Lit;
use crate::transport::World;
use crate::with_tracer;
use glam::Vec3;
use layout::Side;
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// A twentieth of the places of all seams may show a larger step than this share of the mean light, before it is told.
const SEAM_P95: f64 = 0.05;
/// An object with this many times more or fewer texels per metre than the median is told.
const UNEVEN: f64 = 4.0;
/// A chart of fewer texels than this has more gutter than light around it: 4 by 4 with 2 texels of gutter take 8 by 8.
const FEW_TEXELS: usize = 16;
/// Texture coordinates may leave the page by this share of it: they are 32 bit floats.
const RANGE_SLACK: f32 = 1e-6;

/// What a problem is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// A page is not there or cannot be read.
    Missing,
    /// Node, material, texture, image and scene do not lead to the same light.
    Links,
    /// They disagree about what a texel holds.
    Unit,
    /// Texture coordinates are missing, outside of the page, or not numbers.
    Range,
    /// Two triangles claim a texel.
    Overlap,
    /// Bilinear lookups of two charts read the same texel.
    Gutter,
    /// Much finer or coarser than the rest.
    Density,
    /// Texels that are no light: negative or not finite.
    Texels,
    /// Steps across borders of charts.
    Seams,
    /// The front is dark and the back is lit.
    Flipped,
}

/// Something that is wrong, or looks so.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Problem {
    /// What it is about.
    pub kind: Kind,
    /// Whether the file must not be used so; else it is worth a look.
    pub grave: bool,
    /// The object or file.
    pub at: String,
    /// What is wrong.
    pub what: String,
}

impl Problem {
    fn grave(kind: Kind, at: impl Into<String>, what: impl Into<String>) -> Self {
        Self { kind, grave: true, at: at.into(), what: what.into() }
    }

    fn mild(kind: Kind, at: impl Into<String>, what: impl Into<String>) -> Self {
        Self { grave: false, ..Self::grave(kind, at, what) }
    }
}

/// One page.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PageReport {
    /// The EXR's file name.
    pub file: String,
    /// Width and height, texels; `None` when it cannot be read.
    pub size: Option<[usize; 2]>,
    /// What a texel holds.
    pub store: String,
    /// Share of the texels whose centre a chart covers.
    pub filled: f64,
    /// Fewest texels between what bilinear lookups of two charts read; `None` when there are more than 16, or when they
    /// read the same.
    pub gap_texels: Option<u32>,
    /// Texels that are negative or not finite.
    pub unlawful_texels: usize,
}

/// One object: all lightmapped surfaces of a node.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ObjectReport {
    /// The node's name.
    pub name: String,
    /// The page.
    pub page: String,
    /// Triangles that cover something.
    pub triangles: usize,
    /// Charts.
    pub charts: usize,
    /// Texels whose centre it covers.
    pub texels: usize,
    /// Texels per metre.
    pub density: Density,
    /// Mean light of its texels, E/π (b/π for pages of radiosity), red, green, blue.
    pub light: [f32; 3],
    /// Largest step on the borders of its charts, as a share of the scene's mean light.
    pub largest_seam: f64,
}

/// What was found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Findings {
    /// The file.
    pub file: PathBuf,
    /// Its pages.
    pub pages: Vec<PageReport>,
    /// Its lightmapped objects, in document order.
    pub objects: Vec<ObjectReport>,
    /// Surfaces that name no lightmap.
    pub surfaces_without: usize,
    /// Steps across borders of charts.
    pub seams: Seams,
    /// What is wrong, grave things first.
    pub problems: Vec<Problem>,
}

impl Findings {
    /// Whether nothing grave was found.
    pub fn passes(&self) -> bool {
        !self.problems.iter().any(|problem| problem.grave)
    }
}

/// Examines a baked file. A page that is missing is a finding, not an error.
pub fn check(baked: &Baked) -> Findings {
    let sides = layout::sides(baked);
    let mut problems = statements::problems(baked);
    problems.extend(range(baked, &sides));
    let mut reports = Vec::new();
    for (index, page) in baked.pages.iter().enumerate() {
        let report = page_report(baked, &sides, index, &mut problems);
        reports.push(PageReport {
            file: page.file.clone(),
            store: statements::name_of(page.store),
            ..report
        });
    }

    let mut objects: BTreeMap<(usize, Option<usize>), Vec<usize>> = BTreeMap::new();
    for (number, side) in sides.iter().enumerate() {
        let origin = &baked.scene.surfaces[side.surface].origin;
        objects.entry((origin.node, origin.instance)).or_default().push(number);
    }
    let mut rows: Vec<ObjectReport> =
        objects.values().map(|numbers| object_report(baked, &sides, numbers)).collect();
    let mean = mean_light(&rows);
    let (seams, own) = seams::measure(baked, &sides, mean);
    for (row, numbers) in rows.iter_mut().zip(objects.values()) {
        row.largest_seam = numbers.iter().map(|&n| own[n]).fold(0.0, f64::max);
    }
    if seams.p95 > SEAM_P95 {
        let (at, p95, largest) = (&seams.between[0], 100.0 * seams.p95, 100.0 * seams.largest);
        let what = format!(
            "a twentieth of all seams shows a step of over {p95:.1} % of the mean light; the largest, {largest:.0} %, is \
             here: more texels per metre or a higher quality make them smaller"
        );
        problems.push(Problem::mild(Kind::Seams, at, what));
    }
    problems.extend(uneven(&rows));
    problems.extend(sparse(&rows));
    problems.extend(turned(baked, &sides, &objects.into_values().collect::<Vec<_>>(), &rows, mean));
    problems.sort_by(|a, b| (!a.grave, a.kind, &a.at, &a.what).cmp(&(!b.grave, b.kind, &b.at, &b.what)));
    problems.dedup();
    Findings {
        file: baked.document.path.clone(),
        pages: reports,
        objects: rows,
        surfaces_without: baked.bare_surfaces().count(),
        seams,
        problems,
    }
}

/// Coordinates outside of the page.
fn range(baked: &Baked, sides: &[Side]) -> Vec<Problem> {
    let mut found = Vec::new();
    for side in sides {
        let Ok(image) = &baked.pages[side.page].image else { continue };
        let size = glam::Vec2::new(image.size[0] as f32, image.size[1] as f32);
        let lawful = |p: &glam::Vec2| {
            let uv = *p / size;
            uv.is_finite() && uv.min_element() >= -RANGE_SLACK && uv.max_element() <= 1.0 + RANGE_SLACK
        };
        let outside = side.corners.iter().flatten().filter(|p| !lawful(p)).count();
        if outside > 0 {
            let name = &baked.scene.surfaces[side.surface].origin.name;
            let what = format!("{outside} corners of its triangles lie outside of the page or nowhere");
            found.push(Problem::grave(Kind::Range, name, what));
        }
    }
    found
}

fn page_report(baked: &Baked, sides: &[Side], index: usize, problems: &mut Vec<Problem>) -> PageReport {
    let page = &baked.pages[index];
    let mut report = PageReport {
        file: String::new(),
        size: None,
        store: String::new(),
        filled: 0.0,
        gap_texels: None,
        unlawful_texels: 0,
    };
    let Ok(image) = &page.image else { return report };
    let facts = pages::look(sides, index, image.size);
    let name = |surface: usize| baked.scene.surfaces[surface].origin.name.clone();
    for (kind, pairs, what) in [
        (Kind::Overlap, &facts.claimed_twice, "are claimed twice"),
        (Kind::Gutter, &facts.read_twice, "are read by bilinear lookups of two charts, so light bleeds"),
    ] {
        for (&(one, other), count) in pairs {
            let (one, other) = (name(one), name(other));
            let with = if one == other { "within it".to_owned() } else { format!("by it and {other}") };
            problems.push(Problem::grave(kind, one, format!("{count} texels {what}, {with}")));
        }
    }
    let unlawful = image.value.iter().filter(|v| !v.is_finite() || v.min_element() < 0.0).count();
    if unlawful > 0 {
        let what = format!("{unlawful} texels are negative or not finite numbers");
        problems.push(Problem::grave(Kind::Texels, &page.file, what));
    }
    report.size = Some(image.size);
    report.filled = facts.covered as f64 / (image.size[0] * image.size[1]).max(1) as f64;
    report.gap_texels = facts.gap;
    report.unlawful_texels = unlawful;
    report
}

fn object_report(baked: &Baked, sides: &[Side], numbers: &[usize]) -> ObjectReport {
    let own: Vec<&Side> = numbers.iter().map(|&n| &sides[n]).collect();
    let (mut texels, mut sum) = (0, glam::DVec3::ZERO);
    for side in &own {
        let page = &baked.pages[side.page];
        let Ok(image) = &page.image else { continue };
        let scale = page.white_radiance_scale().unwrap_or(1.0 / std::f32::consts::PI);
        for (corners, _) in side.corners.iter().zip(&side.chart).filter(|(_, c)| **c != layout::NO_CHART) {
            pages::claimed(corners, image.size, |i| {
                texels += 1;
                if image.value[i].is_finite() {
                    sum += (image.value[i] * scale).as_dvec3();
                }
            });
        }
    }
    let covering = |side: &&Side| side.chart.iter().filter(|chart| **chart != layout::NO_CHART).count();
    ObjectReport {
        name: baked.scene.surfaces[own[0].surface].origin.name.clone(),
        page: baked.pages[own[0].page].file.clone(),
        triangles: own.iter().map(covering).sum(),
        charts: own.iter().map(|side| side.charts.len()).sum(),
        texels,
        density: density::of(&baked.scene, &own),
        light: (sum / texels.max(1) as f64).as_vec3().to_array(),
        largest_seam: 0.0,
    }
}

/// Mean light of all objects by area, its brightest channel.
fn mean_light(rows: &[ObjectReport]) -> f32 {
    let area: f64 = rows.iter().map(|row| row.density.area_m2).sum();
    let sum: glam::DVec3 =
        rows.iter().map(|row| Vec3::from_array(row.light).as_dvec3() * row.density.area_m2).sum();
    if area > 0.0 { (sum / area).as_vec3().max_element() } else { 0.0 }
}

/// The density that half of the surface stays below.
fn median_density(rows: &[ObjectReport]) -> f64 {
    let mut sorted: Vec<(f64, f64)> =
        rows.iter().map(|r| (r.density.texels_per_m, r.density.area_m2)).collect();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
    let area: f64 = sorted.iter().map(|row| row.1).sum();
    density::quantile(sorted.into_iter(), area / 2.0)
}

fn uneven(rows: &[ObjectReport]) -> Vec<Problem> {
    let median = median_density(rows);
    let told = |row: &&ObjectReport| {
        let ratio = row.density.texels_per_m / median;
        row.density.area_m2 > 0.0 && median > 0.0 && !(1.0 / UNEVEN..=UNEVEN).contains(&ratio)
    };
    rows.iter()
        .filter(told)
        .map(|row| {
            let own = row.density.texels_per_m;
            let what = format!("it has {own:.3} texels per metre, most of the scene has {median:.3}");
            Problem::mild(Kind::Density, &row.name, what)
        })
        .collect()
}

/// Objects and pages that have too few texels to show their light.
fn sparse(rows: &[ObjectReport]) -> Vec<Problem> {
    let mut found: Vec<Problem> = rows
        .iter()
        .filter(|row| row.triangles > 0 && row.texels == 0)
        .map(|row| {
            let what = "no texel's middle lies on it, so it shows the light of what is around it: more texels per metre                         (--page-size, --max-pages, or lightkiln.density on the object) give it its own";
            Problem::mild(Kind::Density, &row.name, what)
        })
        .collect();
    let mut pages: BTreeMap<&str, (usize, usize)> = BTreeMap::new();
    for row in rows {
        let (texels, charts) = pages.entry(&row.page).or_default();
        *texels += row.texels;
        *charts += row.charts;
    }
    for (page, (texels, charts)) in pages {
        if charts > 0 && texels < charts * FEW_TEXELS {
            let what = format!(
                "its {charts} charts share {texels} texels: gutters take the page, shadows have no room; bake with a                  larger --page-size or more pages"
            );
            found.push(Problem::mild(Kind::Density, page, what));
        }
    }
    found
}

/// Objects whose normals look the wrong way.
fn turned(
    baked: &Baked,
    sides: &[Side],
    objects: &[Vec<usize>],
    rows: &[ObjectReport],
    mean: f32,
) -> Vec<Problem> {
    let front = |row: &ObjectReport| Vec3::from_array(row.light).max_element();
    let dark: Vec<usize> =
        (0..rows.len()).filter(|&i| rows[i].texels > 0 && front(&rows[i]) < flipped::DARK * mean).collect();
    if dark.is_empty() {
        return Vec::new();
    }
    let world = World::new(&baked.scene);
    let lit = Lit::new(baked);
    with_tracer!(world.tracer(&baked.scene), tracer => {
        let mut found = Vec::new();
        for &i in &dark {
            let surfaces: Vec<usize> = objects[i].iter().map(|&n| sides[n].surface).collect();
            let back = flipped::back_light(baked, tracer, &lit, &surfaces).max_element();
            if flipped::is_suspect(front(&rows[i]), back, mean) {
                let what = format!(
                    "its front is dark ({:.3}) while its back stands in the light ({back:.3}): its normals look flipped",
                    front(&rows[i])
                );
                found.push(Problem::mild(Kind::Flipped, &rows[i].name, what));
            }
        }
        found
    })
}
