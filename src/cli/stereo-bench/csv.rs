//! Every frame as a line of comma-separated values.

use super::suite::Outcome;
use std::fmt::Write;

/// Columns. Times in ms, lengths in mm.
const HEADER: &str = "series,volume,x,y,z,rays,radius_mm,width,height,views,method,quadrature,run,frame,frame_ms,clipping_ms,\
    spherical_ray_cast_ms,rendering_ms,overhead_ms,voxels_clipped,voxels_affected,voxels_untouched";

/// All frames of all results; runs count from 1, frames from 0.
pub fn table(results: &[Outcome]) -> String {
    let mut text = format!("{HEADER}\n");
    for Outcome { series, configuration: c, measured, .. } in results {
        let ([x, y, z], o) = (c.input.volume.dims, c.setup.occlusion);
        let setting = format!(
            "{series},{},{x},{y},{z},{},{},{},{},{}",
            quoted(&c.input.name),
            o.rays.name(),
            o.radius_mm,
            c.size[0],
            c.size[1],
            c.views
        );
        for m in measured {
            let quadrature = m.method.setup(c.setup).occlusion.quadrature.name();
            for (run, frames) in m.runs.iter().enumerate() {
                for (n, frame) in frames.iter().enumerate() {
                    let [clipping, rays, rendering, overhead] = frame.parts();
                    let v = frame.categories;
                    // Writing to a string cannot fail.
                    let _ = writeln!(
                        text,
                        "{setting},{},{quadrature},{},{n},{:.4},{clipping:.4},{rays:.4},{rendering:.4},{overhead:.4},{},{},{}",
                        m.method,
                        run + 1,
                        frame.wall,
                        v.clipped,
                        v.affected,
                        v.untouched
                    );
                }
            }
        }
    }
    text
}

/// A field that a comma or a quote inside does not end (RFC 4180).
fn quoted(field: &str) -> String {
    match field.contains([',', '"', '\n']) {
        true => format!("\"{}\"", field.replace('"', "\"\"")),
        false => field.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    #[test]
    fn fields_with_commas_and_quotes_are_quoted() {
        assert_eq!(super::quoted("builtin:engine:8"), "builtin:engine:8");
        assert_eq!(super::quoted("a,\"b\".nrrd"), "\"a,\"\"b\"\".nrrd\"");
    }
}
