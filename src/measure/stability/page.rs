//! A finding as files: its data as CSV, its charts as drawings, and all of them on one page of HTML that needs no other file.

use super::{Chart, Finding, Ours, Quantity, Role, Series, Trial};
use crate::plot::{Anchor, Axis, Drawing, INK, Marker, Panel, text_width};
use std::fmt::Write as _;

/// Size of a chart in pixels without its legend.
const WIDTH: f64 = 760.0;
const HEIGHT: f64 = 420.0;
/// Room around the panel: left, top, right, bottom (numbers and label of the axis).
const ROOM: [f64; 4] = [84.0, 34.0, 24.0, 54.0];
/// Height of a line of the legend and of the caption.
const LINE: f64 = 18.0;

/// Blues and greens are ours, reds and oranges what fails (Okabe and Ito's palette, and shades of it), greys yardsticks: told apart
/// by readers who see fewer colours, too, for their markers differ.
const OURS: [&str; 4] = ["#0072b2", "#009e73", "#56b4e9", "#004b76"];
const CONTROL: [&str; 6] = ["#d55e00", "#e69f00", "#cc79a7", "#8c3d00", "#b00020", "#b5a400"];
const YARDSTICK: [&str; 2] = ["#555555", "#999999"];
const MARKERS: [Marker; 4] = [Marker::Circle, Marker::Square, Marker::Triangle, Marker::Diamond];

/// Colour and marker of the series that is the `nth` of its role.
fn style(role: Role, nth: usize) -> (&'static str, Marker) {
    let colours: &[_] = match role {
        Role::Ours => &OURS,
        Role::Control => &CONTROL,
        Role::Yardstick => &YARDSTICK,
    };
    (colours[nth % colours.len()], MARKERS[nth % MARKERS.len()])
}

/// A chart with legend and caption.
pub fn draw(chart: &Chart, setting: &str) -> Drawing {
    let caption = wrapped(setting, 11, WIDTH - ROOM[0] - ROOM[2]);
    let lines = chart.series.len() + caption.len();
    let mut drawing = Drawing::new(WIDTH, HEIGHT + LINE * (lines as f64 + 1.0));
    let values = |i: usize| chart.series.iter().flat_map(move |s| s.points.iter().map(move |p| p[i]));
    let axis = |quantity: &Quantity, i: usize| match quantity.log {
        true => Axis::log(quantity.label.as_str(), values(i)),
        false => Axis::linear(quantity.label.as_str(), values(i)),
    };
    let panel = Panel {
        at: [ROOM[0], ROOM[1]],
        size: [WIDTH - ROOM[0] - ROOM[2], HEIGHT - ROOM[1] - ROOM[3]],
        x: axis(&chart.x, 0),
        y: axis(&chart.y, 1),
    };
    panel.draw(&mut drawing, &chart.title);
    let mut before: Vec<Role> = Vec::new();
    let mut y = HEIGHT + LINE * 0.7;
    for series in &chart.series {
        let nth = before.iter().filter(|role| **role == series.role).count();
        let (colour, marker) = style(series.role, nth);
        before.push(series.role);
        // What is not ours is dashed and hollow, so that curves that lie on one another both show.
        let hollow = series.role != Role::Ours;
        let radius = if hollow { 5.0 } else { 3.5 };
        let places: Vec<[f64; 2]> =
            series.points.iter().filter(|p| p[1].is_finite()).map(|p| panel.place(p[0], p[1])).collect();
        drawing.polyline(&places, colour, 2.0, hollow);
        for at in places {
            drawing.marker(marker, at, radius, colour, hollow);
        }
        let at = [ROOM[0] + 12.0, y - 4.0];
        drawing.line([at[0] - 12.0, at[1]], [at[0] + 12.0, at[1]], colour, 2.0, hollow);
        drawing.marker(marker, at, radius, colour, hollow);
        drawing.text([at[0] + 20.0, y], &series.name, 12, Anchor::Start, INK, false);
        y += LINE;
    }
    for line in caption {
        drawing.text([ROOM[0], y + 4.0], &line, 11, Anchor::Start, "#666666", false);
        y += LINE;
    }
    drawing
}

/// Lines of at most this width in pixels, broken between words.
fn wrapped(text: &str, size: u32, width: f64) -> Vec<String> {
    let mut lines = vec![String::new()];
    for word in text.split_whitespace() {
        let last = lines.len() - 1;
        let longer = format!("{} {word}", lines[last]);
        match text_width(&longer, size) <= width || lines[last].is_empty() {
            true => lines[last] = longer.trim_start().into(),
            false => lines.push(word.into()),
        }
    }
    lines
}

/// The data of a finding, one row for each point.
pub fn csv(finding: &Finding) -> String {
    let quoted = |text: &str| format!("\"{}\"", text.replace('"', "\"\""));
    let mut rows = String::from("chart,series,x,y,x_axis,y_axis\n");
    for chart in &finding.charts {
        for Series { name, points, .. } in &chart.series {
            for [x, y] in points {
                let row = [&chart.title, name].map(|text| quoted(text)).join(",");
                let axes = [&chart.x.label, &chart.y.label].map(|text| quoted(text)).join(",");
                // Writing to a String cannot fail.
                let _ = writeln!(rows, "{row},{x},{y},{axes}");
            }
        }
    }
    rows
}

/// All findings on a page of HTML; `head` says with what and on what they were computed.
pub fn html(head: &str, findings: &[(Trial, Finding)]) -> String {
    let mut page = format!(
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<title>Where methods fail</title>\n\
         <meta name=\"viewport\" content=\"width=device-width\">\n<style>\n{STYLE}</style>\n</head>\n<body>\n\
         <h1>Where methods fail, ours beside them</h1>\n<p class=\"head\">{}</p>\n<table>\n",
        escaped(head)
    );
    for (trial, finding) in findings {
        let _ = writeln!(
            page,
            "<tr><td><a href=\"#{0}\">{0}</a></td><td class=\"{1}\">{1}</td><td>{2}</td></tr>",
            trial.name,
            judged(finding),
            escaped(&finding.sentence)
        );
    }
    page += "</table>\n";
    for (trial, finding) in findings {
        let _ = writeln!(
            page,
            "<section id=\"{}\">\n<h2>{}</h2>\n<p>{}</p>",
            trial.name,
            escaped(trial.title),
            escaped(&finding.sentence)
        );
        for chart in &finding.charts {
            let _ = writeln!(page, "<figure>{}</figure>", inline(&draw(chart, &finding.setting).svg()));
        }
        page += "</section>\n";
    }
    page + "</body>\n</html>\n"
}

/// How ours did, in a word; `vacuous` where nothing failed that should.
fn judged(finding: &Finding) -> &'static str {
    match finding.ours {
        Ours::Fails => "fails",
        _ if !finding.control_fails => "vacuous",
        ours => ours.name(),
    }
}

const STYLE: &str = "\
body { font: 16px/1.5 DejaVu Sans, Verdana, sans-serif; color: #222; max-width: 62em; margin: 2em auto; padding: 0 1em }
h1 { font-size: 1.5em } h2 { font-size: 1.15em; margin-top: 2.5em }
table { border-collapse: collapse; font-size: 0.85em } td { border-top: 1px solid #ddd; padding: 0.4em 0.8em 0.4em 0; vertical-align: top }
.holds { color: #00664a; font-weight: bold } .limited { color: #8a6100; font-weight: bold }
.fails, .vacuous { color: #b00020; font-weight: bold } .head { color: #555 }
figure { margin: 1em 0 } figure svg { max-width: 100%; height: auto }
";

/// An SVG as part of a page, without what only a file of its own begins with.
fn inline(svg: &str) -> &str {
    svg.find("<svg").map_or(svg, |start| &svg[start..])
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn finding() -> Finding {
        let chart = Chart {
            title: "A \"quoted\", title".into(),
            x: Quantity::linear("eyes, mm"),
            y: Quantity::log("error"),
            series: vec![
                Series::control("theirs", vec![[0.0, 0.5], [1.0, 2.0]]),
                Series::ours("ours <1", vec![[0.0, 0.0], [1.0, f64::NAN]]),
            ],
        };
        Finding {
            charts: vec![chart],
            sentence: "a < b".into(),
            ours: Ours::Holds,
            control_fails: true,
            setting: "many words ".repeat(40),
        }
    }

    #[test]
    fn data_has_a_row_for_each_point_and_quotes_what_needs_it() {
        let text = csv(&finding());
        let rows: Vec<&str> = text.lines().collect();
        assert_eq!(rows.len(), 5);
        assert_eq!(rows[1], "\"A \"\"quoted\"\", title\",\"theirs\",0,0.5,\"eyes, mm\",\"error\"");
    }

    #[test]
    fn the_page_stands_alone_and_escapes_what_it_quotes() {
        let trial = Trial::parse("stereo").unwrap();
        let page = html("device <x>", &[(trial, finding())]);
        assert!(page.contains("a &lt; b") && page.contains("device &lt;x&gt;") && page.contains("<svg"));
        for outside in ["src=", "@import", "url(", "<script", "<link", "<?xml"] {
            assert!(!page.contains(outside), "{outside}");
        }
        let vacuous = Finding { control_fails: false, ..finding() };
        assert!(html("", &[(trial, vacuous)]).contains("class=\"vacuous\""));
    }

    #[test]
    fn a_chart_shows_every_series_in_its_legend() {
        let drawing = draw(&finding().charts[0], &finding().setting);
        let svg = drawing.svg();
        assert!(svg.contains("theirs") && svg.contains("ours &lt;1") && svg.contains("eyes, mm"), "{svg}");
    }

    #[test]
    fn lines_are_no_wider_than_asked() {
        let lines = wrapped(&"word ".repeat(100), 11, 300.0);
        assert!(lines.len() > 5 && lines.iter().all(|line| text_width(line, 11) <= 300.0));
        assert_eq!(lines.join(" "), "word ".repeat(100).trim());
    }
}
