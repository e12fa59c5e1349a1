//! Reading volumes: every format, from the page cache. 96³ values of 16 bits, 1.7 MiB.

#![forbid(unsafe_code)]

use cao_formats::write_nrrd;
use cao_model::values::Values;
use cao_model::volume::Volume;
use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use flate2::{Compression, write::GzEncoder};
use std::fs;
use std::io::{self, Write};
use std::path::Path;

const EDGE: usize = 96;

/// Values that compress about as well as a scan: a built-in volume's with two bits of noise.
fn values() -> Vec<i16> {
    let engine = cao_formats::open(format!("builtin:engine:{EDGE}")).expect("a built-in volume");
    let mut random = cao_measure::random::Random::new(1);
    (0..engine.len()).map(|i| 16 * engine.value(i) as i16 + random.below(4) as i16).collect()
}

fn nifti_header() -> Vec<u8> {
    let mut header = vec![0; 352];
    header[..4].copy_from_slice(&348_i32.to_le_bytes());
    let edge = EDGE as i16;
    for (i, d) in [3, edge, edge, edge, 1, 1, 1, 1].into_iter().enumerate() {
        header[40 + 2 * i..][..2].copy_from_slice(&d.to_le_bytes());
    }
    header[70..72].copy_from_slice(&4_i16.to_le_bytes());
    header[72..74].copy_from_slice(&16_i16.to_le_bytes());
    for i in 0..8 {
        header[76 + 4 * i..][..4].copy_from_slice(&1_f32.to_le_bytes());
    }
    header[108..112].copy_from_slice(&352_f32.to_le_bytes());
    header[344..348].copy_from_slice(b"n+1\0");
    header
}

fn gzipped(bytes: &[u8]) -> io::Result<Vec<u8>> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::default());
    encoder.write_all(bytes)?;
    encoder.finish()
}

fn write(folder: &Path) -> io::Result<Vec<String>> {
    let raw: Vec<u8> = values().iter().flat_map(|v| v.to_le_bytes()).collect();
    let packed = gzipped(&raw)?;
    let sizes = format!("{EDGE} {EDGE} {EDGE}");
    let nrrd = |encoding: &str| {
        format!(
            "NRRD0004\ntype: short\ndimension: 3\nsizes: {sizes}\nendian: little\nencoding: {encoding}\n\n"
        )
    };
    let meta = format!(
        "ObjectType = Image\nNDims = 3\nDimSize = {sizes}\nElementType = MET_SHORT\nElementDataFile = LOCAL\n"
    );
    let nifti = [nifti_header(), raw.clone()].concat();
    let files = [
        ("raw.nrrd", [nrrd("raw").into_bytes(), raw.clone()].concat()),
        ("gzip.nrrd", [nrrd("gzip").into_bytes(), packed].concat()),
        ("nifti.nii.gz", gzipped(&nifti)?),
        ("nifti.nii", nifti),
        ("metaimage.mha", [meta.into_bytes(), raw].concat()),
    ];
    for (name, bytes) in &files {
        fs::write(folder.join(name), bytes)?;
    }
    Ok(files.map(|(name, _)| name.to_owned()).into())
}

fn readers(criterion: &mut Criterion) {
    let folder = tempfile::tempdir().expect("a folder for files");
    let names = write(folder.path()).expect("files");
    let mut group = criterion.benchmark_group("readers");
    group.throughput(Throughput::Bytes(2 * EDGE.pow(3) as u64));
    for name in names {
        let path = folder.path().join(&name);
        group.bench_function(&name, |b| b.iter(|| cao_formats::read(&path).expect("a readable file")));
    }
    let like = Volume::new([EDGE; 3], [1.0; 3], Values::I16(values())).expect("a volume");
    let ambient = vec![0.5; like.len()];
    let target = folder.path().join("written.nrrd");
    group.bench_function("write.nrrd", |b| {
        b.iter(|| write_nrrd(&target, &like, &ambient, "ambient factor").expect("a written file"));
    });
    group.bench_function("builtin", |b| {
        b.iter(|| cao_formats::open(format!("builtin:engine:{EDGE}")).expect("a volume"));
    });
    group.finish();
}

criterion_group! { name = benches; config = cao_benches::brief(); targets = readers }
criterion_main!(benches);
