//! Every case of `lightkiln study stability`, group by group.

use lightkiln::study::stability::GROUPS;

/// Runs a group and names every case that is not within its bound.
fn holds(name: &str) {
    let group = GROUPS.iter().find(|group| group.name == name).expect("there is such a group");
    let checks = (group.run)().expect("every case can be run");
    assert!(!checks.is_empty(), "{name} is empty");
    let failed: Vec<String> = checks
        .iter()
        .filter(|check| !check.holds())
        .map(|check| {
            let (error, bound) = (check.error(), check.bound);
            format!(
                "{} ({}; {}): {}, expected {}: off by {error:.3e}, allowed {bound:.3e}",
                check.case, check.way, check.place, check.found, check.expected
            )
        })
        .collect();
    let (many, all) = (failed.len(), checks.len());
    assert!(failed.is_empty(), "{}: {many} of {all} failed\n{}", group.title, failed.join("\n"));
}

macro_rules! groups {
    ($($name:ident)*) => {
        $(
            #[test]
            fn $name() {
                holds(stringify!($name));
            }
        )*

        #[test]
        fn every_group_is_tested() {
            let tested = [$(stringify!($name)),*];
            assert_eq!(GROUPS.iter().map(|group| group.name).collect::<Vec<_>>(), tested);
        }
    };
}

groups! {
    parallel
    perpendicular
    closed
    needles
    discs
    points
    facets
    furnaces
    plates
    shells
    integrating
    khodulev
    baked_furnaces
    baked_rooms
    baked_bodies
    lamps
    skies
    geometry
    extremes
    written
    invariance
}
