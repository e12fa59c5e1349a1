//! Methods that compute V_AO brick by brick from V_o alone, with contextual updates from change (method.md §5.2): V_o is brought up to date
//! in place and compared with what V_AO was computed from; bricks within reach of a change are computed anew, with one write a voxel, and
//! no other brick is touched. Exact for any edit, clips, transfer function, values, radius: a value depends on nothing but the opacities
//! within its reach. What needs no value holds 1, whatever it held before.
//!
//! A method says how far it reaches and how it computes the bricks of a list ([`Gather`]); [`ByBrick`] does the rest.
//!
//! No V_PAO, no mask, no second opacity: 4 bytes a voxel beside the volume, and some 32 bytes a brick of 512.

use crate::Result;
use crate::ambient::{Ambient, Changed, Fields, Recomputation, Recomputed, Written};
use crate::clip::carve::{self, Carve};
use crate::clip::classify::{AFFECTED, UNTOUCHED};
use crate::clip::clip_bricks::ClipBricks;
use crate::drive::{self, Pace, Part, Take};
use crate::field::bricks::BrickList;
use crate::field::near::{self, FAR, Near, Reach, TODO};
use crate::field::ones::Ones;
use crate::field::{BRICK, Field, volume_image};
use crate::host::read_buffer;
use crate::stages;
use crate::subject::Subject;
use cao_gpu::{Access, Buffer, BufferUse, Format, Gpu, Image, Recorder, Stage, Timings};
use cao_model::settings::Setup;

/// How a method computes the values of some bricks from V_o.
pub trait Gather: Send + Sync + Sized {
    /// Its name, for who has no device for it.
    const NAME: &str;

    /// Format of V_AO.
    const FORMAT: Format = Format::R16Unorm;
    /// Whether values are of V and the transfer function, and not of V_o alone: then an edit of these concerns every one.
    const OF_VALUES: bool = false;

    /// Format of V_AO by these settings, where there are several. Where it is another it is made anew.
    fn format(on: &Subject) -> Format {
        let _ = on;
        Self::FORMAT
    }

    /// For the subject's settings. Uses the device's queue and waits for it.
    ///
    /// # Errors
    /// Settings that this method does not have, and those of the device.
    fn new(on: &Subject) -> Result<Self>;

    /// Takes the subject's settings, which are new. Never uses the device's queue.
    ///
    /// # Errors
    /// Settings that this method does not have; then nothing has changed.
    fn set(&mut self, on: &Subject) -> Result<()>;

    /// Whether it has such settings, which may come later.
    ///
    /// # Errors
    /// As [`Self::set`].
    fn accepts(&self, on: &Subject, setup: &Setup) -> Result<()>;

    /// How far a change of opacity can change values.
    fn reach(&self) -> Reach;

    /// What comes before opacities where settings are new.
    fn settings<'a>(&'a self, on: &'a Subject) -> Option<Part<'a>> {
        let _ = on;
        None
    }

    /// Notes bricks in which what values depend on beside opacities changed, with 0 in `change`, after edits of features.
    fn changed<'a>(&'a self, on: &'a Subject, change: &'a Buffer) -> Option<Part<'a>> {
        let _ = (on, change);
        None
    }

    /// What it makes of V_o, after these changes, before it computes values of the bricks of any list: its own volumes, for instance. As many
    /// parts each time: an update that spans frames counts them.
    fn prepare<'a>(&'a self, on: &'a Subject, from: Carved<'a>, changed: Changed) -> Vec<Part<'a>> {
        let _ = (on, from, changed);
        Vec::new()
    }

    /// What its computation is called, and how many bricks it takes at first where nobody knows how long one takes.
    fn stage(&self) -> (Stage, u32);

    /// Computes the listed bricks, or some of them: a value in every voxel that needs one, 1 in the others. Ordered after what
    /// [`Self::prepare`] wrote by its own barriers, V_o is ready to be sampled and read.
    fn record(&self, rec: &mut Recorder, to: &Target, take: &Take) -> Result<()>;
}

/// V_o as it is now.
#[derive(Clone, Copy)]
pub struct Carved<'a> {
    /// V_o.
    pub opacity: &'a Image,
    /// 0 of each brick in which it changed since the last update; says nothing where values are computed anew.
    pub change: &'a Buffer,
}

/// What is computed, and where its values go.
#[derive(Clone, Copy)]
pub struct Target<'a> {
    /// The scene.
    pub on: &'a Subject,
    /// V_o.
    pub opacity: &'a Image,
    /// The bricks to compute.
    pub list: &'a BrickList,
    /// V_AO.
    pub ambient: &'a Image,
}

/// Device memory of one scene, beside the volume itself.
struct Volumes {
    /// V_o: opacity after transfer function and clips, r16unorm.
    opacity: Image,
    /// V_AO.
    ambient: Image,
    /// Bricks that the last update computed, and those that have values, u32 each.
    todo: Buffer,
    /// What the clips do to each brick, u32 each.
    clip_bricks: Buffer,
    clip_bricks_before: Buffer,
    contact: Buffer,
    change: Buffer,
    other: Buffer,
    list: BrickList,
}

impl Volumes {
    /// Allocates them for a field: V_o holds 0 and V_AO 1. Uses the device's queue and waits for it.
    fn new(gpu: &Gpu, field: &Field, method: &str, ambient: Format) -> Result<Self> {
        for (format, name) in [(Format::R16Unorm, "R16_UNORM"), (ambient, "R16G16B16A16_UNORM")] {
            if !(gpu.stores(format) && gpu.filters(format)) {
                return Err(cao_gpu::Error::Device {
                    problem: format!(
                        "has no filtered storage images of {name}, which method {method} needs; choose method cao or lao"
                    ),
                }
                .into());
            }
        }
        let bricks = 4 * u64::from(field.brick_count());
        let brick_buffer = |name| gpu.buffer(name, bricks, BufferUse::Device);
        let volumes = Self {
            opacity: volume_image(gpu, "opacity", field, Format::R16Unorm)?,
            ambient: volume_image(gpu, "ambient", field, ambient)?,
            todo: brick_buffer("bricks to do")?,
            clip_bricks: ClipBricks::buffer(gpu, field)?,
            clip_bricks_before: ClipBricks::buffer(gpu, field)?,
            contact: brick_buffer("contact")?,
            change: brick_buffer("change")?,
            other: brick_buffer("change, other")?,
            list: BrickList::new(gpu, field)?,
        };
        let mut rec = gpu.recorder("clear volumes")?;
        rec.discard(&volumes.opacity);
        rec.discard(&volumes.ambient);
        rec.barrier(&[], &[Access::TransferWrite]);
        rec.clear_image(&volumes.opacity, [0.0; 4])?;
        rec.clear_image(&volumes.ambient, [1.0; 4])?;
        for buffer in [&volumes.contact, &volumes.clip_bricks_before, &volumes.todo] {
            rec.fill(buffer, 0, bricks, 0)?;
        }
        rec.fill(&volumes.change, 0, bricks, FAR)?;
        rec.submit_and_wait()?;
        Ok(volumes)
    }
}

/// The kernels.
struct Kernels {
    clip_bricks: ClipBricks,
    carve: Carve,
    near: Near,
    ones: Ones,
}

impl Kernels {
    /// Builds the pipelines. Uses the device's queue and waits for it.
    fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self {
            clip_bricks: ClipBricks::new(gpu)?,
            carve: Carve::new(gpu)?,
            near: Near::new(gpu)?,
            ones: Ones::new(gpu)?,
        })
    }
}

/// What a recomputation takes for changed: what is made of opacities, too.
const RECOMPUTED: Changed = Changed { opacities: true, anew: true, ..Changed::NOTHING };

/// A method that computes values brick by brick.
pub struct ByBrick<G> {
    kernels: Kernels,
    volumes: Volumes,
    gather: G,
}

impl<G: Gather> ByBrick<G> {
    /// Volumes and pipelines for a subject. Uses the device's queue and waits for it.
    ///
    /// # Errors
    /// As [`Gather::new`], and those of the device.
    pub fn new(on: &Subject) -> Result<Self> {
        let gather = G::new(on)?;
        Ok(Self {
            kernels: Kernels::new(&on.gpu)?,
            volumes: Volumes::new(&on.gpu, &on.field, G::NAME, G::format(on))?,
            gather,
        })
    }

    /// Whether every value has to be computed after these changes.
    fn anew(changed: Changed) -> bool {
        changed.anew || G::OF_VALUES && changed.opacities
    }

    fn target<'a>(&'a self, on: &'a Subject, list: &'a BrickList, ambient: &'a Image) -> Target<'a> {
        Target { on, opacity: &self.volumes.opacity, list, ambient }
    }

    fn carved(&self) -> Carved<'_> {
        Carved { opacity: &self.volumes.opacity, change: &self.volumes.change }
    }

    /// V_o in place, and which bricks changed.
    fn carve<'a>(&'a self, on: &'a Subject, changed: Changed) -> Part<'a> {
        let (k, v) = (&self.kernels, &self.volumes);
        let all = [Access::StorageRead, Access::StorageWrite];
        Part::short(stages::CARVE, move |rec| {
            on.record_clip_bricks(rec, &k.clip_bricks, 0.0, &v.clip_bricks)?;
            let (field, transfer) = on.opacities();
            k.carve.record(
                rec,
                field,
                on.setup.anti_aliasing,
                changed.opacities,
                carve::Bindings {
                    transfer,
                    features: &on.features,
                    clips: &on.clip_set,
                    solids: &on.solids,
                    clip_bricks: &v.clip_bricks,
                    clip_bricks_before: &v.clip_bricks_before,
                    occupancy: &on.occupancy,
                    contact: &v.contact,
                    change: &v.change,
                    list: &v.list,
                    opacity: &v.opacity,
                },
            )?;
            rec.barrier(&all, &[Access::StorageRead, Access::StorageWrite, Access::SampledRead]);
            Ok(())
        })
    }

    /// From changed bricks to those to compute: all that need values if `anew`, whatever there was before.
    fn choose<'a>(&'a self, to: Target<'a>, todo: &'a Buffer, anew: bool) -> Part<'a> {
        let (k, v) = (&self.kernels, &self.volumes);
        Part::short(stages::CHOOSE, move |rec| {
            if anew {
                let written = [Access::StorageRead, Access::StorageWrite];
                rec.barrier(&written, &[Access::TransferWrite, Access::StorageWrite]);
                rec.fill(&v.change, 0, v.change.bytes(), 0)?;
                rec.fill(todo, 0, todo.bytes(), 0)?;
                k.ones.record(rec, to.ambient)?;
                rec.barrier(&[Access::TransferWrite, Access::StorageWrite], &written);
            }
            let bindings = near::Bindings {
                change: &v.change,
                other: &v.other,
                contact: &v.contact,
                todo,
                list: to.list,
            };
            Ok(k.near.record(rec, &to.on.field, to.on.setup.scope, self.gather.reach(), bindings)?)
        })
    }

    /// Values of the chosen bricks.
    fn compute<'a>(&'a self, to: Target<'a>) -> Part<'a> {
        let (stage, first) = self.gather.stage();
        Part::items(stage, to.list.items(&to.on.field), first, move |rec, take| {
            self.gather.record(rec, &to, take)?;
            rec.barrier(
                &[Access::SampledRead, Access::StorageRead, Access::StorageWrite],
                &[Access::SampledRead, Access::StorageWrite, Access::TransferWrite],
            );
            Ok(())
        })
    }
}

impl<G: Gather> Ambient for ByBrick<G> {
    fn set(&mut self, on: &Subject) -> Result<()> {
        self.gather.set(on)
    }

    fn accepts(&self, on: &Subject, setup: &Setup) -> Result<()> {
        self.gather.accepts(on, setup)
    }

    fn update<'a>(&'a self, on: &'a Subject, changed: Changed, into: Option<&'a Image>) -> Vec<Part<'a>> {
        let v = &self.volumes;
        let to = self.target(on, &v.list, into.unwrap_or(&v.ambient));
        let mut parts = Vec::new();
        if changed.anew {
            parts.extend(self.gather.settings(on));
        }
        parts.push(self.carve(on, changed));
        if changed.features {
            parts.extend(self.gather.changed(on, &v.change));
        }
        parts.extend(self.gather.prepare(on, self.carved(), changed));
        parts.extend([self.choose(to, &v.todo, Self::anew(changed)), self.compute(to)]);
        parts
    }

    fn clips<'a>(&'a self, on: &'a Subject) -> Part<'a> {
        let (k, v) = (&self.kernels, &self.volumes);
        Part::short(stages::CLIPS, move |rec| on.record_clip_bricks(rec, &k.clip_bricks, 0.0, &v.clip_bricks))
    }

    fn written(&self, changed: Changed) -> Written<'_> {
        // Anew the others are ones again.
        Written { list: &self.volumes.list, all: Self::anew(changed) }
    }

    fn fields(&self) -> Fields<'_> {
        let v = &self.volumes;
        Fields { opacity: &v.opacity, ambient: &v.ambient, clip_bricks: &v.clip_bricks }
    }

    fn recompute(
        &self,
        on: &Subject,
        into: &Image,
        progress: &mut dyn FnMut(f64),
    ) -> Result<(Recomputation<'_>, Timings)> {
        let v = &self.volumes;
        let list = BrickList::new(&on.gpu, &on.field)?;
        let todo = on.gpu.buffer("all bricks to do", v.todo.bytes(), BufferUse::Device)?;
        let to = self.target(on, &list, into);
        let mut parts = self.gather.prepare(on, self.carved(), RECOMPUTED);
        parts.extend([self.choose(to, &todo, true), self.compute(to)]);
        let timings = drive::run(&on.gpu, &parts, &mut Pace::default(), progress)?;
        drop(parts);
        Ok((Recomputation { list, recomputed: Recomputed::Bricks(&v.todo) }, timings))
    }

    /// Tells recomputed bricks from others only, and nothing as clipped.
    fn mask(&self, on: &Subject) -> Result<Vec<u8>> {
        let todo: Vec<u32> = bytemuck::pod_collect_to_vec(&read_buffer(&on.gpu, &self.volumes.todo)?);
        let ([x, y, z], [bx, by, _]) = (on.field.dims, on.field.bricks());
        let mut mask = Vec::with_capacity(x as usize * y as usize * z as usize);
        for k in 0..z {
            for j in 0..y {
                let row = (k / BRICK * by + j / BRICK) * bx;
                let done = |i: u32| todo[(row + i / BRICK) as usize] & TODO != 0;
                mask.extend((0..x).map(|i| if done(i) { AFFECTED as u8 } else { UNTOUCHED as u8 }));
            }
        }
        Ok(mask)
    }
}
