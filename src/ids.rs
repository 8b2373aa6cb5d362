//! Ids as types: an index of one kind cannot be used where another is meant.

macro_rules! id {
    ($(#[$doc:meta])* $name:ident) => {
        $(#[$doc])*
        #[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Default)]
        #[repr(transparent)]
        pub struct $name(pub u32);

        impl $name {
            /// The id as an index into a slice.
            #[inline(always)]
            pub fn idx(self) -> usize {
                self.0 as usize
            }
        }

        impl From<usize> for $name {
            /// # Panics
            /// If `i` does not fit in 32 bits; meshes are validated to stay below that.
            #[inline]
            fn from(i: usize) -> Self {
                $name(u32::try_from(i).expect("id fits in 32 bits"))
            }
        }

        impl std::fmt::Display for $name {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                self.0.fmt(f)
            }
        }
    };
}

id!(
    /// A vertex of the control mesh, in file order.
    VertexId
);
id!(
    /// A face of the control mesh, in file order.
    FaceId
);
id!(
    /// A patch: a quad of the limit surface. One per quad face, n per n-gon; dense per mesh.
    PatchId
);
id!(
    /// A mesh of the scene, in scene-file order.
    MeshId
);
