//! A study as one HTML page that needs nothing from outside: style, plotting library, data and pictures are in it.

use super::{Axis, Cell, Figure, Look, Mark, Picture, Series, Sheet, Study};
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use maud::{DOCTYPE, Markup, PreEscaped, html};
use plotly::common::{ExponentFormat, Line, Mode, Title};
use plotly::layout::{AxisType, BarMode, Layout};
use plotly::{Bar, Configuration, Plot, Scatter};

const STYLE: &str = "
body { font: 16px/1.5 system-ui, sans-serif; margin: 2rem auto; max-width: 72rem; padding: 0 1rem; color: #1c1c1e; background: #fff; }
h1 { font-size: 1.7rem; } h2 { font-size: 1.2rem; margin-top: 2.5rem; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-size: .85rem; font-variant-numeric: tabular-nums; }
th, td { padding: .25rem .6rem; border-bottom: 1px solid #ddd; text-align: left; vertical-align: top; }
th { position: sticky; top: 0; background: #fff; }
td.number { text-align: right; white-space: nowrap; } td:first-child { white-space: nowrap; }
tr.best { background: #e8f5e9; } tr.failed { background: #ffe3e0; }
.pictures { display: grid; grid-template-columns: repeat(auto-fit, minmax(20rem, 1fr)); gap: 1rem; margin-top: 1rem; }
figure { margin: 0; } img { width: 100%; image-rendering: pixelated; } figcaption { font-size: .9rem; }
.plot { height: 30rem; }
";

pub fn html(study: &Study) -> String {
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                link rel="icon" href="data:,";
                title { "lightkiln: " (study.title) }
                style { (PreEscaped(STYLE)) }
                @if !study.figures.is_empty() { (PreEscaped(plotting_library())) }
            }
            body {
                h1 { (study.title) }
                @for paragraph in &study.text { p { (paragraph) } }
                @for (i, shown) in study.figures.iter().enumerate() { (figure(i, shown)) }
                @if !study.pictures.is_empty() {
                    div.pictures { @for shown in &study.pictures { (picture(shown)) } }
                }
                @for sheet in &study.sheets { (table(sheet)) }
            }
        }
    };
    page.into_string()
}

/// The plotting library's script alone; the typesetter for formulas that comes with it is left out.
fn plotting_library() -> String {
    let mut scripts = Plot::offline_js_sources();
    if let Some(second) = scripts.rfind("<script type=\"text/javascript\">").filter(|&at| at > 0) {
        scripts.truncate(second);
    }
    scripts
}

fn picture(picture: &Picture) -> Markup {
    html! {
        figure {
            img alt=(picture.caption) src=(format!("data:image/png;base64,{}", STANDARD.encode(&picture.png)));
            figcaption { (picture.caption) }
        }
    }
}

fn table(sheet: &Sheet) -> Markup {
    let cell = |cell: &Cell| {
        html! {
            td.number[cell.is_number()] { (cell.text()) }
        }
    };
    html! {
        h2 { (sheet.title) }
        div.wide {
            table {
                thead { tr { @for column in &sheet.columns { th { (column) } } } }
                tbody {
                    @for row in &sheet.rows {
                        tr.best[row.mark == Mark::Best].failed[row.mark == Mark::Failed] {
                            @for value in &row.cells { (cell(value)) }
                        }
                    }
                }
            }
        }
    }
}

fn figure(number: usize, figure: &Figure) -> Markup {
    let mut plot = Plot::new();
    for series in &figure.series {
        plot.add_trace(trace(series));
    }
    let layout = Layout::new()
        .title(Title::with_text(escaped(&figure.title)))
        .x_axis(axis(&figure.x))
        .y_axis(axis(&figure.y))
        .bar_mode(BarMode::Group)
        .auto_size(true);
    plot.set_layout(layout);
    plot.set_configuration(Configuration::new().responsive(true).display_logo(false));
    html! { div.plot { (PreEscaped(plot.to_inline_html(Some(&format!("plot-{number}"))))) } }
}

fn trace(series: &Series) -> Box<dyn plotly::Trace> {
    let words: Vec<String> = series.words.iter().map(|words| escaped(words)).collect();
    let name = escaped(&series.name);
    match series.look {
        Look::Bars => Bar::new(words, series.y.clone()).name(name),
        Look::Front => Scatter::new(series.x.clone(), series.y.clone())
            .name(name)
            .mode(Mode::Lines)
            .line(Line::new().width(9.0).color("rgba(0, 0, 0, 0.13)"))
            .text_array(words),
        look => {
            let mode = if look == Look::Lines { Mode::LinesMarkers } else { Mode::Markers };
            Scatter::new(series.x.clone(), series.y.clone()).name(name).mode(mode).text_array(words)
        }
    }
}

fn axis(axis: &Axis) -> plotly::layout::Axis {
    let kind = if axis.logarithmic { AxisType::Log } else { AxisType::Default };
    plotly::layout::Axis::new()
        .title(Title::with_text(escaped(&axis.label)))
        .type_(kind)
        .exponent_format(ExponentFormat::Power)
        .auto_margin(true)
}

/// The library reads a few tags in texts: names out of files must not become any, nor end the script they stand in.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}
