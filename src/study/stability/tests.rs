use super::*;
use crate::study::Mark;

fn made(expected: f64, found: f64, bound: f64) -> Check {
    Check::new("case", expected, found, bound, "because").by("way").at("here")
}

#[test]
fn errors_are_relative_but_where_nothing_is_expected() {
    assert_eq!(made(4.0, 5.0, 0.0).error(), 0.25);
    assert_eq!(made(-4.0, -5.0, 0.0).error(), 0.25);
    assert_eq!(made(0.0, -0.5, 0.0).error(), 0.5);
    for found in [f64::NAN, f64::INFINITY] {
        assert!(made(1.0, found, 1e300).error().is_infinite() && !made(1.0, found, 1e300).holds());
    }
    assert!(made(1.0, 1.0, 0.0).holds() && !made(1.0, 1.0 + f64::EPSILON, 0.0).holds());
    assert!(!made(1.0, 1.0, f64::NAN).holds());
    assert!(Check::fact("so", true, "").holds() && !Check::fact("not so", false, "").holds());
}

#[test]
fn one_failed_case_fails_the_study_and_is_shown() {
    let groups = [&GROUPS[0], &GROUPS[1]];
    let good = (0..1200).map(|_| made(1.0, 1.0, 0.0)).collect::<Vec<_>>();
    let passing = study(&[(groups[0], good.clone()), (groups[1], vec![made(2.0, 2.001, 1e-2)])]);
    assert!(passing.passes());
    // The long table is for the files; the short one for the screen.
    let names: Vec<_> = passing.on_screen().iter().map(|sheet| sheet.name).collect();
    assert_eq!(names, ["groups"]);
    let csv = passing.sheets[0].csv().unwrap();
    assert!(csv.lines().count() == 1202 && csv.contains("2.001000000"), "{csv}");
    let failing = study(&[(groups[0], good), (groups[1], vec![made(2.0, 2.001, 1e-6)])]);
    assert!(!failing.passes());
    let shown = failing.on_screen();
    assert_eq!(shown[0].rows.len(), 1);
    assert!(shown[0].screen(240).contains("FAIL") && shown[1].rows[1].mark == Mark::Failed);
}

#[test]
fn digits_are_ten() {
    let shown = [0.0, 0.199824895698387, 3141.592653589793, 1e8, 3.182886673e-5].map(digits);
    assert_eq!(shown, ["0", "0.199824896", "3141.592654", "1.000000000e8", "3.182886673e-5"]);
}

#[test]
fn groups_have_names_of_their_own() {
    let names: std::collections::BTreeSet<_> = GROUPS.iter().map(|group| group.name).collect();
    assert_eq!(names.len(), GROUPS.len());
}
