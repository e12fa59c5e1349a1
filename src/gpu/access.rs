//! The one table of memory accesses: what a barrier's two sides may name, and what each means to Vulkan.

use ash::vk::{AccessFlags2 as A, PipelineStageFlags2 as S};

/// A way of touching memory. A barrier names what came before and what comes after:
/// `rec.barrier(&[StorageWrite], &[SampledRead])`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Access {
    /// Source of a copy.
    TransferRead,
    /// Destination of a copy, fill, update or clear.
    TransferWrite,
    /// `var<storage>` or `texture_storage_*` read by a compute shader.
    StorageRead,
    /// `var<storage>` or `texture_storage_*` written by a compute shader.
    StorageWrite,
    /// `texture_*` read by a compute shader.
    SampledRead,
    /// `var<uniform>` read by a compute shader.
    UniformRead,
    /// Arguments of an indirect dispatch.
    IndirectRead,
    /// Anything read by a vertex or fragment shader.
    GraphicsRead,
    /// Colour or depth attachment, loaded, tested, blended or stored.
    AttachmentWrite,
    /// What an acceleration structure is built of: triangles, instances, a lower level.
    BuildRead,
    /// An acceleration structure that is built, and the scratch memory of that.
    BuildWrite,
    /// An acceleration structure read by a compute shader's ray queries.
    QueryRead,
    /// Mapped memory read by the program after the commands have run.
    HostRead,
    /// Mapped memory written by the program before they run.
    HostWrite,
}

impl Access {
    /// The table: pipeline stages and access masks.
    fn row(self) -> (S, A) {
        match self {
            Access::TransferRead => (S::ALL_TRANSFER, A::TRANSFER_READ),
            Access::TransferWrite => (S::ALL_TRANSFER, A::TRANSFER_WRITE),
            Access::StorageRead => (S::COMPUTE_SHADER, A::SHADER_STORAGE_READ),
            Access::StorageWrite => (S::COMPUTE_SHADER, A::SHADER_STORAGE_WRITE),
            Access::SampledRead => (S::COMPUTE_SHADER, A::SHADER_SAMPLED_READ),
            Access::UniformRead => (S::COMPUTE_SHADER, A::UNIFORM_READ),
            Access::IndirectRead => (S::DRAW_INDIRECT, A::INDIRECT_COMMAND_READ),
            Access::GraphicsRead => (
                S::VERTEX_SHADER | S::FRAGMENT_SHADER,
                A::SHADER_SAMPLED_READ | A::SHADER_STORAGE_READ | A::UNIFORM_READ,
            ),
            Access::AttachmentWrite => (
                S::COLOR_ATTACHMENT_OUTPUT | S::EARLY_FRAGMENT_TESTS | S::LATE_FRAGMENT_TESTS,
                A::COLOR_ATTACHMENT_READ
                    | A::COLOR_ATTACHMENT_WRITE
                    | A::DEPTH_STENCIL_ATTACHMENT_READ
                    | A::DEPTH_STENCIL_ATTACHMENT_WRITE,
            ),
            Access::BuildRead => {
                (S::ACCELERATION_STRUCTURE_BUILD_KHR, A::SHADER_READ | A::ACCELERATION_STRUCTURE_READ_KHR)
            }
            Access::BuildWrite => (
                S::ACCELERATION_STRUCTURE_BUILD_KHR,
                A::ACCELERATION_STRUCTURE_READ_KHR | A::ACCELERATION_STRUCTURE_WRITE_KHR,
            ),
            Access::QueryRead => (S::COMPUTE_SHADER, A::ACCELERATION_STRUCTURE_READ_KHR),
            Access::HostRead => (S::HOST, A::HOST_READ),
            Access::HostWrite => (S::HOST, A::HOST_WRITE),
        }
    }

    /// Whether it changes memory.
    pub fn writes(self) -> bool {
        matches!(
            self,
            Access::TransferWrite
                | Access::StorageWrite
                | Access::AttachmentWrite
                | Access::BuildWrite
                | Access::HostWrite
        )
    }

    /// One bit for each access.
    pub(crate) fn bit(self) -> u16 {
        1 << self as u16
    }

    /// Pipeline stages and access masks of several accesses together; of those that draw only where something can, of those of ray queries
    /// only where there are some.
    pub(crate) fn union(list: &[Access], graphics: bool, rays: bool) -> (S, A) {
        let drawing = |access: Access| matches!(access, Access::GraphicsRead | Access::AttachmentWrite);
        let of_rays =
            |access: Access| matches!(access, Access::BuildRead | Access::BuildWrite | Access::QueryRead);
        let there = |access: Access| (graphics || !drawing(access)) && (rays || !of_rays(access));
        let list = list.iter().filter(|access| there(**access));
        list.fold((S::NONE, A::NONE), |(stages, masks), access| {
            let row = access.row();
            (stages | row.0, masks | row.1)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn several_accesses_unite_stages_and_masks() {
        let list = [Access::StorageWrite, Access::TransferRead, Access::GraphicsRead, Access::QueryRead];
        let (stages, masks) = Access::union(&list[..2], true, true);
        assert_eq!(stages, S::COMPUTE_SHADER | S::ALL_TRANSFER);
        assert_eq!(masks, A::SHADER_STORAGE_WRITE | A::TRANSFER_READ);
        let without = Access::union(&list, false, false);
        assert_eq!(without, (stages, masks), "no stage and no access that the device does not have");
    }
}
