//! Texel formats, without Vulkan: size and what a shader reads. Vulkan's names are the Vulkan layer's.

/// Texel format of an image.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Format {
    /// One 8-bit channel, 0…255 read as 0…1.
    R8Unorm,
    /// One 8-bit unsigned integer.
    R8Uint,
    /// One 16-bit channel, 0…65535 read as 0…1.
    R16Unorm,
    /// One 16-bit unsigned integer.
    R16Uint,
    /// One half float.
    R16Float,
    /// One float.
    R32Float,
    /// One 32-bit unsigned integer.
    R32Uint,
    /// Two floats.
    Rg32Float,
    /// Four 8-bit channels read as 0…1, linear.
    Rgba8Unorm,
    /// The same, coded by the curve of sRGB, which reading and writing undo and do.
    Rgba8Srgb,
    /// Four 8-bit channels, blue first, read as 0…1, linear.
    Bgra8Unorm,
    /// The same, coded by the curve of sRGB.
    Bgra8Srgb,
    /// Ten bits each of red (the lowest), green and blue, two of alpha, read as 0…1.
    A2b10g10r10Unorm,
    /// Four 16-bit channels, 0…65535 read as 0…1.
    Rgba16Unorm,
    /// Four half floats.
    Rgba16Float,
    /// Four floats.
    Rgba32Float,
    /// Depth, 16 bits read as 0…1.
    D16Unorm,
    /// Depth, 24 bits read as 0…1, beside 8 bits of stencil, which are left alone.
    D24UnormS8,
    /// Depth, one float.
    D32Float,
}

impl Format {
    /// The table: bytes of a texel, what a shader reads.
    fn row(self) -> (u64, Texel) {
        match self {
            Self::R8Unorm => (1, Texel::Float),
            Self::R8Uint => (1, Texel::Uint),
            Self::R16Unorm | Self::R16Float => (2, Texel::Float),
            Self::R16Uint => (2, Texel::Uint),
            Self::R32Float => (4, Texel::Float),
            Self::R32Uint => (4, Texel::Uint),
            Self::Rg32Float => (8, Texel::Float),
            Self::Rgba8Unorm | Self::Rgba8Srgb | Self::Bgra8Unorm | Self::Bgra8Srgb => (4, Texel::Float),
            Self::A2b10g10r10Unorm => (4, Texel::Float),
            Self::Rgba16Unorm | Self::Rgba16Float => (8, Texel::Float),
            Self::Rgba32Float => (16, Texel::Float),
            Self::D16Unorm => (2, Texel::Depth),
            Self::D24UnormS8 | Self::D32Float => (4, Texel::Depth),
        }
    }

    /// Bytes of one texel.
    pub fn bytes(self) -> u64 {
        self.row().0
    }

    /// What a shader reads.
    pub fn texel(self) -> Texel {
        self.row().1
    }
}

/// What a texel reads as in a shader.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Texel {
    /// `f32`
    Float,
    /// `u32`
    Uint,
    /// `i32`
    Sint,
    /// `texture_depth_*`
    Depth,
}
