//! Ambient occlusion methods, each on one page: dispatch, visible barrier, dispatch.

pub mod cao;
pub mod lao;
pub mod volumes;

/// How the ambient volume is brought up to date.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// Local ambient occlusion, everything recomputed at every change.
    Lao,
    /// Contextual ambient occlusion: only what a clip changed is recomputed.
    Cao,
}

impl Method {
    /// `lao` or `cao`.
    pub fn parse(name: &str) -> crate::Result<Self> {
        match name {
            "lao" => Ok(Self::Lao),
            "cao" => Ok(Self::Cao),
            _ => Err(crate::Error::Config {
                what: "method".into(),
                problem: format!("\"{name}\"; expected lao or cao"),
            }),
        }
    }
}
