//! The report: one HTML file that stands alone. Drawings are inline, pictures are data; nothing is fetched.

use super::draw;
use super::looks_draw;
use super::meshes_panel;
use super::peers::Peers;
use super::pictures::{SATURATED, Shown};
use super::tables::{self, escaped};
use super::{Change, Chart};
use crate::Result;
use crate::contender::SOLID;
use crate::plot::{Drawing, short};
use cao_formats::Picture;
use std::fmt::Write as _;

const STYLE: &str = "
body { font: 15px/1.5 'DejaVu Sans', Verdana, sans-serif; color: #222; background: #fff; margin: 0 auto; max-width: 1080px; padding: 24px }
h1 { font-size: 24px } h2 { font-size: 19px; margin-top: 40px; border-bottom: 1px solid #ccc } h3 { font-size: 16px }
p.small, li.small, figcaption { font-size: 13px; color: #555 }
table { border-collapse: collapse; font-size: 13px; margin: 12px 0 }
th, td { padding: 3px 10px; border-bottom: 1px solid #ddd; text-align: left; vertical-align: top; white-space: nowrap }
th { border-bottom: 2px solid #888 } .n { text-align: right; white-space: nowrap }
.wide { overflow-x: auto } svg { max-width: 100%; height: auto }
.methods { display: flex; flex-wrap: wrap; gap: 18px } figure { margin: 0; width: 340px }
figure img { width: 168px; height: 168px; object-fit: contain; background: #17191d }
figure img.error { image-rendering: pixelated; background: #d8d8d8 }
details summary { cursor: pointer }
";

/// The report of a chart; `machine` names the computer, `command` is what made it.
///
/// # Errors
/// [`cao_model::Error::Config`] where a picture cannot be encoded.
pub fn html(chart: &Chart, machine: &str, command: &str, peers: Option<&Peers>) -> Result<String> {
    let every: Vec<_> = chart.scenes.iter().collect();
    let mut body =
        head("Ambient occlusion after a change: time against error", machine, command, &chart.caption());
    body += &section("The chart", "");
    body += &inline(&draw::draw(chart, &every, &[]));
    if every.len() > 1 {
        for scene in &every {
            let name = escaped(&scene.name);
            let drawing = inline(&draw::draw(chart, &[scene], &[]));
            let _ = writeln!(body, "<details><summary>{name} alone</summary>\n{drawing}</details>");
        }
    }
    body += &methods(chart)?;
    body += &section(
        "Error of the picture",
        "The same ambient values, drawn with other steps, samples and resolutions.",
    );
    body += &inline(&looks_draw::draw(chart));
    body += &tables::pictures(chart);
    if let Some(found) = &chart.meshes {
        body += &section(
            "Meshes: time against error",
            "Ambient occlusion of pixels: volumes, rays and methods of image space on built-in scenes of meshes. cao chart --meshes has the tables and figures of their paper.",
        );
        body += &inline(&meshes_panel::draw(found));
    }
    body += &section(
        "What can change in real time",
        "Table 1 of the paper has ticks; ours has times, at one setting of each method.",
    );
    body += &tables::table_1(chart);
    body += &section("What a clip makes recompute", "Table 2 of the paper, and ours.");
    body += &tables::table_2(chart);
    body += &section("Frame rates while the clip moves", "Table 3 of the paper, and ours.");
    body += &tables::table_3(chart, false);
    body += &section(
        "What a frame is spent on",
        "As the paper's Fig. 9: median times of the stages of a frame in which the clip moved, both eyes.",
    );
    body += &inline(&tables::figure_9(chart));
    body += &section(
        "What volumes of means take",
        "Table 1.1 of Smooth Probabilistic Ambient Occlusion, and ours.",
    );
    body += &tables::spao(chart);
    if let Some(peers) = peers {
        body += &section("Peers in the same run", "What tools/peers measured beside this program.");
        body += &tables::peers(peers);
    }
    body += &section("Every number", "Means over the scenes; every run of every method is in runs.csv.");
    for change in Change::ALL {
        let table = tables::everything(chart, change);
        let _ = writeln!(body, "<details><summary>{}</summary>\n{table}</details>", change.name());
    }
    Ok(page("cao chart", &body))
}

/// A page that stands alone.
pub(super) fn page(title: &str, body: &str) -> String {
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>{title}</title><style>{STYLE}</style></head>\n<body>\n{body}</body></html>\n"
    )
}

pub(super) fn section(title: &str, says: &str) -> String {
    let says = if says.is_empty() { String::new() } else { format!("<p>{}</p>\n", escaped(says)) };
    format!("<h2>{}</h2>\n{says}", escaped(title))
}

/// What a page begins with.
pub(super) fn head(title: &str, machine: &str, command: &str, caption: &[String]) -> String {
    let mut html = format!(
        "<h1>{}</h1>\n<p class=\"small\">{}; command: <code>{}</code></p>\n",
        escaped(title),
        escaped(machine),
        escaped(command)
    );
    for line in caption {
        let _ = writeln!(html, "<p class=\"small\">{}</p>", escaped(line));
    }
    html
}

/// Pictures of a paper by its numbers, each with what it shows; `style` is of the pictures.
///
/// # Errors
/// [`cao_model::Error::Config`] where a picture cannot be encoded.
pub(super) fn figures<'a>(
    figures: impl IntoIterator<Item = (u32, &'a str, &'a Picture)>,
    style: &str,
) -> Result<String> {
    let mut html = String::new();
    for (number, shows, picture) in figures {
        let _ = writeln!(
            html,
            "<p><img style=\"{style}\" alt=\"figure {number}\" src=\"{}\"></p>\n<p class=\"small\">Fig. {number}, {}</p>",
            data(&picture.png()?),
            escaped(shows)
        );
    }
    Ok(html)
}

/// A drawing inside the page, where SVG needs no name space.
pub(super) fn inline(drawing: &Drawing) -> String {
    let svg = drawing.svg().replacen(" xmlns=\"http://www.w3.org/2000/svg\"", "", 1);
    // Sizes in the page are the page's own.
    match (number(&svg, " width=\""), number(&svg, " height=\"")) {
        (Some(width), Some(height)) => {
            svg.replacen("<svg", &format!("<svg viewBox=\"0 0 {width} {height}\""), 1) + "\n"
        }
        _ => svg + "\n",
    }
}

fn number<'a>(svg: &'a str, before: &str) -> Option<&'a str> {
    svg.split_once(before)?.1.split('"').next()
}

fn methods(chart: &Chart) -> Result<String> {
    let Some(scene) = chart.scenes.first() else { return Ok(String::new()) };
    let mut html = section("What each method shows, and where it errs", "");
    let _ = writeln!(
        html,
        "<p class=\"small\">{}, left eye. Beside each picture the error of the ambient factor on the surface that it shows: white none, red too bright, blue too dark, full colour at {SATURATED}.</p>\n<div class=\"methods\">",
        escaped(&scene.name)
    );
    for shown in &scene.pictures {
        let ms = |method: &str| scene.draws.iter().find(|(name, _)| *name == method).map(|(_, ms)| *ms);
        html += &figure(shown, ms(shown.method).zip(ms(SOLID)))?;
    }
    Ok(html + "</div>\n")
}

/// `drawing` has the ms of drawing both eyes, and of doing so in solid colour.
fn figure(shown: &Shown, drawing: Option<(f64, f64)>) -> Result<String> {
    let picture = data(&shown.picture.png()?);
    let name = format!("<b>{}</b>, {}", escaped(shown.method), escaped(&shown.setting.name()));
    let drawn = match drawing {
        Some((own, solid)) => format!("; drawn in {} × solid colour's time", short(own / solid)),
        None => String::new(),
    };
    let (Some(error), Some(e), Some(shape)) = (&shown.error, &shown.errors, &shown.shape) else {
        return Ok(format!(
            "<figure><img alt=\"picture\" src=\"{picture}\"><figcaption>{name}: no ambient values{drawn}</figcaption></figure>\n"
        ));
    };
    Ok(format!(
        "<figure><img alt=\"picture\" src=\"{picture}\"><img class=\"error\" alt=\"error\" src=\"{}\"><figcaption>{name}: RMSE {:.4}, tone fitted {:.4}, bias {:+.4}, largest {:.3} at {} points of the surface{drawn}</figcaption></figure>\n",
        data(&error.png()?),
        e.rmse,
        shape.rmse,
        e.bias,
        e.max,
        e.count
    ))
}

/// A PNG as a data URI (RFC 2397).
fn data(png: &[u8]) -> String {
    format!("data:image/png;base64,{}", base64(png))
}

/// RFC 4648.
fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for group in bytes.chunks(3) {
        let word = (0..3).fold(0_u32, |word, i| word << 8 | u32::from(group.get(i).copied().unwrap_or(0)));
        for i in 0..4 {
            let digit = DIGITS[(word >> (18 - 6 * i) & 63) as usize];
            text.push(if i <= group.len() { char::from(digit) } else { '=' });
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    /// RFC 4648 §10.
    #[test]
    fn base64_of_the_rfcs_own_examples() {
        for (plain, coded) in [
            ("", ""),
            ("f", "Zg=="),
            ("fo", "Zm8="),
            ("foo", "Zm9v"),
            ("foob", "Zm9vYg=="),
            ("fooba", "Zm9vYmE="),
            ("foobar", "Zm9vYmFy"),
        ] {
            assert_eq!(base64(plain.as_bytes()), coded);
        }
    }

    #[test]
    fn a_drawing_in_a_page_names_no_address_and_scales() {
        let svg = inline(&Drawing::new(300.0, 200.0));
        assert!(!svg.contains("http"), "{svg}");
        assert!(svg.contains("viewBox=\"0 0 300 200\""), "{svg}");
    }
}
