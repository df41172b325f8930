//! The `kinds!` list: one line per kind makes the enum, the dispatch and the
//! scene-file names.

/// Declares the kinds of a room.
///
/// ```ignore
/// kinds! {
///     /// What scatters light at a surface.
///     pub enum Bsdf {
///         Diffuse(diffuse::Diffuse) = ["diffuse"],
///         Dielectric(dielectric::Dielectric) = ["dielectric"],
///     }
/// }
/// ```
/// makes the enum, a `From` for each kind and `Bsdf::NAMES`, the scene-file
/// names in order. Dispatch is a `match` with one arm per kind beside it. A
/// kind under `#[cfg]` has one name. Variants that no file names follow after a
/// `;`, without a list of names.
#[allow(unused_macros, reason = "used by the rooms above")]
macro_rules! kinds {
    ($(#[$meta:meta])* pub enum $name:ident {
        $($(#[$vmeta:meta])* $variant:ident($ty:ty) = [$($file_name:literal),* $(,)?]),* $(,)?
        $(; $($(#[$xmeta:meta])* $unnamed:ident($xty:ty)),* $(,)?)?
    }) => {
        $(#[$meta])*
        pub enum $name {
            $($(#[$vmeta])* $variant($ty)),*
            $(, $($(#[$xmeta])* $unnamed($xty)),*)?
        }

        impl $name {
            /// Names of these kinds in scene files.
            #[allow(unused_doc_comments, reason = "a kind's `cfg` comes along with its documentation")]
            pub const NAMES: &'static [&'static str] = &[$($(#[$vmeta])* $($file_name),*),*];
        }

        $($(#[$vmeta])* impl From<$ty> for $name {
            fn from(kind: $ty) -> Self {
                $name::$variant(kind)
            }
        })*
        $($($(#[$xmeta])* impl From<$xty> for $name {
            fn from(kind: $xty) -> Self {
                $name::$unnamed(kind)
            }
        })*)?
    };
    ($(#[$meta:meta])* pub enum $name:ident<$life:lifetime> {
        $($(#[$vmeta:meta])* $variant:ident($ty:ty) = [$($file_name:literal),* $(,)?]),* $(,)?
    }) => {
        $(#[$meta])*
        pub enum $name<$life> {
            $($(#[$vmeta])* $variant($ty)),*
        }

        impl<$life> $name<$life> {
            /// Names of these kinds in scene files.
            #[allow(unused_doc_comments, reason = "a kind's `cfg` comes along with its documentation")]
            pub const NAMES: &'static [&'static str] = &[$($(#[$vmeta])* $($file_name),*),*];
        }

        $($(#[$vmeta])* impl<$life> From<$ty> for $name<$life> {
            fn from(kind: $ty) -> Self {
                $name::$variant(kind)
            }
        })*
    };
}
#[allow(unused_imports, reason = "used by the rooms above")]
pub(crate) use kinds;
