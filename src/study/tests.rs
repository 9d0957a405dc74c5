use super::*;

fn sample() -> Study {
    let row = |words: &str, value, mark| Row { cells: vec![words.into(), Cell::Share(value)], mark };
    Study {
        name: "sample",
        title: "A <b> title & more".to_owned(),
        text: vec!["</script><script>alert(1)</script>".to_owned()],
        sheets: vec![Sheet {
            name: "rows",
            title: "Rows".to_owned(),
            columns: vec!["what", "error"],
            rows: vec![row("a, \"quoted\"", 0.0125, Mark::Best), row("b", 1.0 / 3.0, Mark::Plain)],
        }],
        figures: vec![Figure {
            title: "</script>".to_owned(),
            series: vec![Series {
                name: "s".into(),
                x: vec![1.0],
                y: vec![2.0],
                words: vec!["<i>".into()],
                ..Series::default()
            }],
            ..Figure::default()
        }],
        pictures: Vec::new(),
    }
}

#[test]
fn csv_keeps_words_and_digits() {
    let csv = sample().sheets[0].csv().unwrap();
    let expected = "what,error,mark\n\"a, \"\"quoted\"\"\",0.0125,best\nb,0.3333333333333333,\n";
    assert_eq!(csv, expected);
}

#[test]
fn a_page_holds_all_it_needs_and_no_name_becomes_markup() {
    let page = sample().html();
    assert!(
        page.contains("A &lt;b&gt; title &amp; more")
            && page.contains("&lt;/script&gt;&lt;script&gt;alert(1)")
    );
    assert!(page.contains("Plotly.newPlot") && page.contains("1.2 %"));
    assert!(
        !page.contains("<script src") && !page.contains("<link rel=\"stylesheet\""),
        "something comes from outside"
    );
    let plain = Study { figures: Vec::new(), ..sample() };
    assert!(plain.html().len() < 10_000, "no plot, no plotting library");
}

#[test]
fn a_failed_row_fails_the_study() {
    let mut study = sample();
    assert!(study.passes());
    study.sheets[0].rows[1].mark = Mark::Failed;
    assert!(!study.passes());
}

#[test]
fn files_are_named_after_the_study() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("deep/er");
    let written = write(&sample(), &out).unwrap();
    assert_eq!(written, [out.join("sample.csv"), out.join("sample.html")]);
    assert!(written.iter().all(|file| file.is_file()));
}
