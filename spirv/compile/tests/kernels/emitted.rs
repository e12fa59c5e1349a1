/// Kernel `awkward.wgsl`.
pub mod awkward {
    pub use super::shared::outer::*;
    pub use super::shared::parts::*;
    /// Code, entry points and bindings.
    #[allow(unsafe_code, reason = "the build keeps the promise of `Shader::new`")]
    pub static SHADER: crate::gpu::Shader = {
        use cao_reflect::*;
        // SAFETY: code and reflection are of one module that naga validated.
        unsafe { crate::gpu::Shader::new(Shader {
        name: "awkward",
        spirv: &[
        ],
        entry_points: &[
            EntryPoint { name: "main", stage: Stage::Compute, workgroup: [4, 4, 2], push_bytes: 0, uses: &[
                Use { binding: 0, reads: true, writes: false },
                Use { binding: 1, reads: true, writes: true },
                Use { binding: 2, reads: true, writes: false },
                Use { binding: 3, reads: true, writes: false },
                Use { binding: 4, reads: true, writes: false },
                Use { binding: 5, reads: false, writes: true },
            ] },
            EntryPoint { name: "list_words", stage: Stage::Compute, workgroup: [64, 1, 1], push_bytes: 0, uses: &[
                Use { binding: 5, reads: false, writes: true },
            ] },
            EntryPoint { name: "clear_words", stage: Stage::Compute, workgroup: [32, 1, 1], push_bytes: 0, uses: &[
                Use { binding: 5, reads: false, writes: true },
            ] },
            EntryPoint { name: "nothing", stage: Stage::Compute, workgroup: [1, 1, 1], push_bytes: 0, uses: &[
            ] },
        ],
        bindings: &[
            Binding { name: "awkward", group: 0, binding: 0, kind: BindingKind::Uniform, min_bytes: 1184, image: None, reads: true, writes: false },
            Binding { name: "counted", group: 0, binding: 1, kind: BindingKind::Storage, min_bytes: 48, image: None, reads: true, writes: true },
            Binding { name: "outer", group: 0, binding: 2, kind: BindingKind::Storage, min_bytes: 64, image: None, reads: true, writes: false },
            Binding { name: "volume", group: 0, binding: 3, kind: BindingKind::Sampled, min_bytes: 0, image: Some(ImageBinding { view: ViewDim::D3, texel: Texel::Float, format: None }), reads: true, writes: false },
            Binding { name: "linear", group: 0, binding: 4, kind: BindingKind::Sampler, min_bytes: 0, image: None, reads: true, writes: false },
            Binding { name: "words", group: 0, binding: 5, kind: BindingKind::Storage, min_bytes: 4, image: None, reads: false, writes: true },
        ],
        push_bytes: 0,
        }) }
    };
    /// `const STEP = 8`
    pub const STEP: i32 = 8;
    /// `const BELOW: i32 = -STEP - 1`
    pub const BELOW: i32 = -9;
    /// In radians,
    /// all the way round.
    pub const TURN: f32 = 6.2831855;
    /// `const TINY = 1e-6`
    pub const TINY: f32 = 1e-6;
    /// `const MASK = ~0u`
    pub const MASK: u32 = 4294967295;
    /// `const WIDE = ALL_CHANGED > 4u`
    pub const WIDE: bool = true;
    /// `const TILE = vec2(8u, 4u)`
    pub const TILE: [u32; 2] = [8, 4];
    /// `const MIXED = vec4(vec2(1.0, 2.0), vec2(3.0))`
    pub const MIXED: [f32; 4] = [1.0, 2.0, 3.0, 3.0];
    /// `const ZERO = vec3<i32>()`
    pub const ZERO: [i32; 3] = [0; 3];
    /// `const OFFSETS = array(vec3(0.5), vec3(1.0, 2.0, 3.0))`
    pub const OFFSETS: [[f32; 3]; 2] = [[0.5; 3], [1.0, 2.0, 3.0]];
    /// `const SCALED = mat2x2(TURN, 0.0, 0.0, 1.0)`
    pub const SCALED: [[f32; 2]; 2] = [[6.2831855, 0.0], [0.0, 1.0]];
    /// Of all kinds.
    #[repr(C)]
    #[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
    pub struct Awkward {
        /// no gap behind it
        pub normal: [f32; 3],
        /// `weight: f32`
        pub weight: f32,
        /// `centre: vec3<f32>`
        pub centre: [f32; 3],
        /// Padding.
        pub pad_1: [u32; 1],
        /// `size: vec2<u32>`
        pub size: [u32; 2],
        /// Padding.
        pub pad_2: [u32; 2],
        /// `corner: vec3<i32>`
        pub corner: [i32; 3],
        /// Padding.
        pub pad_3: [u32; 1],
        /// `points: array<vec3<f32>, 2>`
        pub points: [[f32; 4]; 2],
        /// `inner: Inner`
        pub inner: Inner,
        /// `turn: mat3x3<f32>`
        pub turn: [[f32; 4]; 3],
        /// `view: mat4x4<f32>`
        pub view: [[f32; 4]; 4],
        /// `narrow: mat2x2<f32>`
        pub narrow: [[f32; 2]; 2],
        /// `pad: u32`
        pub pad: u32,
        /// `in: u32`
        pub r#in: u32,
        /// Padding.
        pub pad_4: [u32; 6],
        /// `@align(32) far: f32`
        pub far: f32,
        /// Padding.
        pub pad_5: [u32; 3],
        /// `many: array<vec4<f32>, 54>`
        pub many: [[f32; 4]; 54],
        /// Padding.
        pub pad_6: [u32; 4],
    }
    const _: () = {
        assert!(size_of::<Awkward>() == 1184);
        assert!(core::mem::offset_of!(Awkward, normal) == 0);
        assert!(core::mem::offset_of!(Awkward, weight) == 12);
        assert!(core::mem::offset_of!(Awkward, centre) == 16);
        assert!(core::mem::offset_of!(Awkward, pad_1) == 28);
        assert!(core::mem::offset_of!(Awkward, size) == 32);
        assert!(core::mem::offset_of!(Awkward, pad_2) == 40);
        assert!(core::mem::offset_of!(Awkward, corner) == 48);
        assert!(core::mem::offset_of!(Awkward, pad_3) == 60);
        assert!(core::mem::offset_of!(Awkward, points) == 64);
        assert!(core::mem::offset_of!(Awkward, inner) == 96);
        assert!(core::mem::offset_of!(Awkward, turn) == 128);
        assert!(core::mem::offset_of!(Awkward, view) == 176);
        assert!(core::mem::offset_of!(Awkward, narrow) == 240);
        assert!(core::mem::offset_of!(Awkward, pad) == 256);
        assert!(core::mem::offset_of!(Awkward, r#in) == 260);
        assert!(core::mem::offset_of!(Awkward, pad_4) == 264);
        assert!(core::mem::offset_of!(Awkward, far) == 288);
        assert!(core::mem::offset_of!(Awkward, pad_5) == 292);
        assert!(core::mem::offset_of!(Awkward, many) == 304);
        assert!(core::mem::offset_of!(Awkward, pad_6) == 1168);
    };
    /// `struct Counted`
    #[repr(C)]
    #[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
    pub struct Counted {
        /// `total: atomic<u32>`
        pub total: u32,
        /// Padding.
        pub pad: [u32; 3],
    }
    const _: () = {
        assert!(size_of::<Counted>() == 16);
        assert!(core::mem::offset_of!(Counted, total) == 0);
        assert!(core::mem::offset_of!(Counted, pad) == 4);
    };
    impl Counted {
        /// Bytes before `parts`, whose length only the buffer decides.
        pub const PARTS_AT: u64 = 16;
    }
    /// Invocations `[x, y, z]` of a workgroup of `main`.
    pub const MAIN_WORKGROUP: [u32; 3] = [4, 4, 2];
    /// Invocations `[x, y, z]` of a workgroup of `list_words`.
    pub const LIST_WORDS_WORKGROUP: [u32; 3] = [64, 1, 1];
    /// Invocations `[x, y, z]` of a workgroup of `clear_words`.
    pub const CLEAR_WORDS_WORKGROUP: [u32; 3] = [32, 1, 1];
    /// Invocations `[x, y, z]` of a workgroup of `nothing`.
    pub const NOTHING_WORKGROUP: [u32; 3] = [1, 1, 1];
    /// What `main` touches.
    #[derive(Clone, Copy)]
    pub struct MainBindings<'a> {
        /// What there is to do.
        pub awkward: &'a crate::gpu::Buffer,
        /// `var<storage, read_write> counted: Counted`
        pub counted: &'a crate::gpu::Buffer,
        /// `var<storage, read> outer: Outer`
        pub outer: &'a crate::gpu::Buffer,
        /// `var volume: texture_3d<f32>`
        pub volume: &'a crate::gpu::Image,
        /// `var linear: sampler`
        pub linear: &'a crate::gpu::Sampler,
        /// `var<storage, read_write> words: Words`
        pub words: &'a crate::gpu::Buffer,
    }
    impl crate::gpu::Bindings for MainBindings<'_> {
        fn list(&self) -> Vec<(&str, crate::gpu::Bind<'_>)> {
            vec![
                ("awkward", self.awkward.into()),
                ("counted", self.counted.into()),
                ("outer", self.outer.into()),
                ("volume", self.volume.into()),
                ("linear", self.linear.into()),
                ("words", self.words.into()),
            ]
        }
    }
    /// What `list_words` touches.
    #[derive(Clone, Copy)]
    pub struct ListWordsBindings<'a> {
        /// `var<storage, read_write> words: Words`
        pub words: &'a crate::gpu::Buffer,
    }
    impl crate::gpu::Bindings for ListWordsBindings<'_> {
        fn list(&self) -> Vec<(&str, crate::gpu::Bind<'_>)> {
            vec![
                ("words", self.words.into()),
            ]
        }
    }
    /// What `clear_words` touches.
    pub type ClearWordsBindings<'a> = ListWordsBindings<'a>;
}
/// Kernel `picture.wgsl`.
pub mod picture {
    pub use super::shared::parts::*;
    /// Code, entry points and bindings.
    #[allow(unsafe_code, reason = "the build keeps the promise of `Shader::new`")]
    pub static SHADER: crate::gpu::Shader = {
        use cao_reflect::*;
        // SAFETY: code and reflection are of one module that naga validated.
        unsafe { crate::gpu::Shader::new(Shader {
        name: "picture",
        spirv: &[
        ],
        entry_points: &[
            EntryPoint { name: "corner", stage: Stage::Vertex, workgroup: [0, 0, 0], push_bytes: 0, uses: &[
                Use { binding: 0, reads: true, writes: false },
            ] },
            EntryPoint { name: "shade", stage: Stage::Fragment, workgroup: [0, 0, 0], push_bytes: 16, uses: &[
                Use { binding: 1, reads: true, writes: false },
            ] },
        ],
        bindings: &[
            Binding { name: "corners", group: 0, binding: 0, kind: BindingKind::Storage, min_bytes: 32, image: None, reads: true, writes: false },
            Binding { name: "before", group: 0, binding: 1, kind: BindingKind::Sampled, min_bytes: 0, image: Some(ImageBinding { view: ViewDim::D2, texel: Texel::Float, format: None }), reads: true, writes: false },
        ],
        push_bytes: 16,
        }) }
    };
    /// `struct Look`
    #[repr(C)]
    #[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
    pub struct Look {
        /// `tint: vec3<f32>`
        pub tint: [f32; 3],
        /// Padding.
        pub pad: [u32; 1],
    }
    const _: () = {
        assert!(size_of::<Look>() == 16);
        assert!(core::mem::offset_of!(Look, tint) == 0);
        assert!(core::mem::offset_of!(Look, pad) == 12);
    };
    /// What `corner` with `shade` touches.
    #[derive(Clone, Copy)]
    pub struct DrawBindings<'a> {
        /// `var<storage, read> corners: array<Inner>`
        pub corners: &'a crate::gpu::Buffer,
        /// `var before: texture_2d<f32>`
        pub before: crate::gpu::Flat<'a>,
    }
    impl crate::gpu::Bindings for DrawBindings<'_> {
        fn list(&self) -> Vec<(&str, crate::gpu::Bind<'_>)> {
            vec![
                ("corners", self.corners.into()),
                ("before", self.before.into()),
            ]
        }
    }
}
/// What kernels include.
pub mod shared {
/// Included file `outer.wgsl`.
pub mod outer {
    /// `struct Outer`
    #[repr(C)]
    #[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
    pub struct Outer {
        /// `inner: array<Inner, 2>`
        pub inner: [super::parts::Inner; 2],
    }
    const _: () = {
        assert!(size_of::<Outer>() == 64);
        assert!(core::mem::offset_of!(Outer, inner) == 0);
    };
}
/// Included file `parts.wgsl`.
pub mod parts {
    /// Bits, the first of eight.
    pub const CHANGED: u32 = 256;
    /// All of them; a \[reference\] and a \<tag> to nowhere.
    pub const ALL_CHANGED: u32 = 65280;
    /// `struct Inner`
    #[repr(C)]
    #[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
    pub struct Inner {
        /// `direction: vec3<f32>`
        pub direction: [f32; 3],
        /// `count: u32`
        pub count: u32,
        /// x, y
        pub place: [u32; 2],
        /// Padding.
        pub pad: [u32; 2],
    }
    const _: () = {
        assert!(size_of::<Inner>() == 32);
        assert!(core::mem::offset_of!(Inner, direction) == 0);
        assert!(core::mem::offset_of!(Inner, count) == 12);
        assert!(core::mem::offset_of!(Inner, place) == 16);
        assert!(core::mem::offset_of!(Inner, pad) == 24);
    };
}
}
