//! The stages of a bake one by one, and the whole of it: `cargo bench --bench stages [NAME] [-- --threads 1]`.
//!
//! Scenes are the fixtures at 512² and the quality `good`. Each stage gets what the stages before it made; only the stage
//! itself is timed. The counter is texels or rays, so the table shows millions a second.

use divan::Bencher;
use divan::counter::ItemsCount;
use lightkiln::atlas::{self, Atlas};
use lightkiln::bake::{self, Run};
use lightkiln::direct::{self, Direct, EmitterList, Faint};
use lightkiln::elements::{self, Elements, Lookup, Patches};
use lightkiln::gather::{self, Bright, Surroundings};
use lightkiln::options::{BakeOptions, ImportOptions, Quality};
use lightkiln::plan::{self, Plan, Wanted};
use lightkiln::progress::{Progress, Silent, Stage};
use lightkiln::scene::{Scene, Sky};
use lightkiln::solve::coarse::{Coarse, Sources, Surfaces, coarse};
use lightkiln::transport::{Hit, OpaqueTracer, World};
use lightkiln::units::{Irradiance, Radiosity};
use lightkiln::{export, import, resolve};
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

/// Fixtures of opaque surfaces: one lamp, statues, sun and sky.
const SCENES: [&str; 3] = ["cornell.glb", "corridor.glb", "window_room.glb"];

static NEVER: AtomicBool = AtomicBool::new(false);

fn main() {
    divan::main();
}

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures").join(name)
}

fn options() -> BakeOptions {
    let mut options = BakeOptions { light: Quality::Good.light(), ..BakeOptions::default() };
    (options.atlas.page_size, options.atlas.max_pages) = (512, 1);
    options
}

fn progress(stage: Stage) -> Progress<'static> {
    Progress::begin(&Silent, &NEVER, stage, 1)
}

/// What a scene is before its light.
struct Dark {
    scene: Scene,
    plan: Plan,
    atlas: Atlas,
    world: World,
    elements: Elements,
    emitters: EmitterList,
    sky: Sky,
}

impl Dark {
    fn new(name: &str) -> Self {
        let (_, scene) =
            import::load(&fixture(name), &ImportOptions::default()).expect("the fixture can be read");
        let plan = plan::plan(&scene, &Wanted::default());
        let atlas = unwrap(&scene, &plan);
        let world = World::new(&scene);
        let elements = rasterise(&scene, &plan, &atlas, &world);
        let (emitters, sky) = direct::collect(&scene, &plan);
        Self { scene, plan, atlas, world, elements, emitters, sky }
    }

    fn tracer(&self) -> OpaqueTracer<'_> {
        OpaqueTracer::new(&self.world)
    }

    fn lit(&self) -> Direct {
        let (effort, mut progress) = (options().light.direct, progress(Stage::Direct));
        direct::light(&self.elements, &self.emitters, &self.plan, &self.tracer(), &effort, 0, &mut progress)
    }

    fn lookup(&self) -> Lookup<'_> {
        Lookup::new(&self.scene, &self.atlas, &self.world, &self.elements)
    }

    fn patches(&self) -> Patches {
        let patches = elements::patches(&self.elements, options().light.solve.patches, |_| true);
        let is_open = |element: u32| self.elements.is_open(element, &self.plan.sight);
        elements::adapt(&self.elements, patches, is_open, |_| true, &self.tracer()).0
    }

    fn solved(&self, lookup: &Lookup, patches: &Patches, direct: &Direct) -> Coarse {
        let tracer = self.tracer();
        let (elements, sight) = (&self.elements, &self.plan.sight);
        let surfaces = Surfaces { elements, lookup, patches, sight, tracer: &tracer };
        let faint = Faint::new(&self.elements, &self.emitters, direct, 0);
        let sources =
            Sources { direct, faint: faint.as_ref(), sky: |direction| self.sky.radiance(direction) };
        let effort = options().light.solve;
        coarse(&surfaces, &sources, &effort, 0, u64::MAX, &mut progress(Stage::Solve))
            .expect("it can be solved")
    }
}

fn unwrap(scene: &Scene, plan: &Plan) -> Atlas {
    let progress = progress(Stage::Atlas);
    atlas::unwrap(scene, &plan.sides, &options().atlas, &progress).expect("it can be unwrapped")
}

fn rasterise(scene: &Scene, plan: &Plan, atlas: &Atlas, world: &World) -> Elements {
    let tracer = OpaqueTracer::new(world);
    let back_counts = |surface: usize| !plan.by_force[surface][1];
    let mut progress = progress(Stage::Elements);
    elements::rasterise(scene, atlas, &back_counts, &tracer, &mut progress).expect("it has elements").0
}

#[divan::bench(args = SCENES, sample_count = 5, sample_size = 1)]
fn a_unwrap(bencher: Bencher, name: &str) {
    let dark = Dark::new(name);
    bencher.counter(ItemsCount::new(dark.elements.len())).bench_local(|| unwrap(&dark.scene, &dark.plan));
}

#[divan::bench(args = SCENES, sample_count = 5, sample_size = 1)]
fn b_tree(bencher: Bencher, name: &str) {
    let dark = Dark::new(name);
    bencher.counter(ItemsCount::new(dark.world.len())).bench_local(|| World::new(&dark.scene));
}

#[divan::bench(args = SCENES, sample_count = 5, sample_size = 1)]
fn c_elements(bencher: Bencher, name: &str) {
    let dark = Dark::new(name);
    let texels = ItemsCount::new(dark.elements.len());
    bencher.counter(texels).bench_local(|| rasterise(&dark.scene, &dark.plan, &dark.atlas, &dark.world));
}

#[divan::bench(args = SCENES, sample_count = 5, sample_size = 1)]
fn d_direct(bencher: Bencher, name: &str) {
    let dark = Dark::new(name);
    let rays = dark.lit().rays;
    bencher.counter(ItemsCount::new(rays)).bench_local(|| dark.lit());
}

#[divan::bench(args = SCENES, sample_count = 5, sample_size = 1)]
fn e_solve(bencher: Bencher, name: &str) {
    let dark = Dark::new(name);
    let (lookup, direct) = (dark.lookup(), dark.lit());
    let patches = dark.patches();
    let rays = dark.solved(&lookup, &patches, &direct).rays;
    bencher.counter(ItemsCount::new(rays)).bench_local(|| dark.solved(&lookup, &dark.patches(), &direct));
}

#[divan::bench(args = SCENES, sample_count = 5, sample_size = 1)]
fn f_gather(bencher: Bencher, name: &str) {
    let dark = Dark::new(name);
    let (lookup, direct, patches, tracer) = (dark.lookup(), dark.lit(), dark.patches(), dark.tracer());
    let solved = dark.solved(&lookup, &patches, &direct);
    let faint = Faint::new(&dark.elements, &dark.emitters, &direct, 0);
    let effort = options().light.gather;
    let gather = || {
        let smooth = gather::spread_over_elements(&dark.elements, &patches, &solved.irradiance);
        let mut radiosity: Vec<Radiosity> = (0..dark.elements.len())
            .map(|e| dark.elements.reflectance[e] * (direct.irradiance[e] + smooth[e]))
            .collect();
        let bright = Bright::take(&dark.elements, &patches, &mut radiosity, effort.rays);
        let around = Surroundings {
            tracer: &tracer,
            sight: &dark.plan.sight,
            radiosity: |hit: &Hit| lookup.element_at(hit).map_or(Radiosity::ZERO, |e| radiosity[e as usize]),
            sky: &dark.sky,
            faint: faint.as_ref(),
            bright: bright.as_ref(),
        };
        gather::gather(&dark.elements, &direct, &smooth, &around, &effort, 0, &mut progress(Stage::Gather))
    };
    let rays = gather().rays;
    bencher.counter(ItemsCount::new(rays)).bench_local(gather);
}

#[divan::bench(args = SCENES, sample_count = 5, sample_size = 1)]
fn g_resolve(bencher: Bencher, name: &str) {
    let dark = Dark::new(name);
    let light: Vec<Irradiance> = dark.lit().irradiance;
    let store = export_options().store;
    let resolve = || resolve::resolve(&dark.scene, &dark.elements, &dark.atlas, &light, store);
    bencher.counter(ItemsCount::new(dark.elements.len())).bench_local(resolve);
}

fn export_options() -> lightkiln::options::ExportOptions {
    options().export
}

/// From file to file.
#[divan::bench(args = SCENES, sample_count = 5, sample_size = 1)]
fn h_whole_bake(bencher: Bencher, name: &str) {
    let folder = tempfile::tempdir().expect("a folder");
    let mut options = options();
    options.export.output = Some(folder.path().join("baked.glb"));
    let input = fixture(name);
    export::output_path(&input, &options.export).expect("a lawful output");
    let bake = || bake::bake(&input, &options, &Run::default()).expect("it can be baked");
    let texels = bake().atlas.texels;
    bencher.counter(ItemsCount::new(texels)).bench_local(bake);
}
