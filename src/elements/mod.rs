//! Atlas -> texel footprints on surfaces: the receivers of light.

mod adapt;
mod band;
mod cells;
mod charts;
mod clip;
mod footprint;
mod lookup;
mod merge;
mod mips;
mod near;
mod patches;
mod place;
mod probe;
mod rasterise;
mod spot;
mod texel;
#[cfg(test)]
pub(crate) mod testing;
#[cfg(test)]
mod tests;
mod validity;

pub use adapt::adapt;
pub use lookup::{Lookup, Weights};
pub use patches::{NO_PATCH, Patches, patches};
pub use rasterise::{Noticed, rasterise};

use crate::plan::Sight;
use crate::units::{Area, Radiance, Reflectance};
use glam::Vec3;
use std::ops::Range;

/// No element: the value of an empty texel in [`PageMap::element`].
pub const NO_ELEMENT: u32 = u32::MAX;

/// Where an element lies in texture space.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TexelRef {
    /// Page index.
    pub page: u32,
    /// Column.
    pub x: u16,
    /// Row, from the top.
    pub y: u16,
}

/// One chart of one placed side: its elements are consecutive.
#[derive(Clone, Debug, PartialEq)]
pub struct Chart {
    /// Rows of [`Elements`], ordered by texel row, then column.
    pub elements: Range<u32>,
    /// Page index.
    pub page: u32,
    /// Texel rectangle, `[min, max)`.
    pub min: [u16; 2],
    /// Exclusive end of the rectangle.
    pub max: [u16; 2],
    /// Surface of the scene.
    pub surface: u32,
    /// Which chart of the surface's unwrap.
    pub source: u32,
    /// Whether this is the back of the surface.
    pub back: bool,
    /// Whether the page is written.
    pub exported: bool,
}

/// Element of each texel of a page.
#[derive(Clone, Debug, PartialEq)]
pub struct PageMap {
    /// Width and height.
    pub size_texels: u32,
    /// Row by row from the top; [`NO_ELEMENT`] where empty.
    pub element: Vec<u32>,
}

/// Structure of arrays, one row per lit texel footprint.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Elements {
    /// Sample position, where rays start (offset from `triangle` as [`crate::transport::World::offset_origin`] does):
    /// the surface at the texel's centre; at a chart's border a point further inside; in contact with other geometry
    /// the nearest free point of the footprint. On smooth surfaces lifted to the shape that their normals describe.
    /// World metres relative to the scene's origin.
    pub position_world: Vec<Vec3>,
    /// Unit normal of the plane, on the lit side.
    pub normal_geometric: Vec<Vec3>,
    /// Unit normal that the cosine is taken with, on the lit side and at most 87° off the plane's.
    pub normal_shading: Vec<Vec3>,
    /// World area of the footprint inside the chart.
    pub area: Vec<Area>,
    /// Mean reflectance over the footprint.
    pub reflectance: Vec<Reflectance>,
    /// Triangle of the world ([`crate::transport::World`]) under the sample.
    pub triangle: Vec<u32>,
    /// Half the footprint's extent along u, metres: half a texel, less where the square around the sample would
    /// leave the chart (0 on slivers).
    pub half_u_world: Vec<Vec3>,
    /// Half the footprint's extent along v (down), metres.
    pub half_v_world: Vec<Vec3>,
    /// Texture space.
    pub texel: Vec<TexelRef>,
    /// False where the sample is buried in or pressed against other geometry.
    pub valid: Vec<bool>,
    /// Whether other geometry than the element's own chart is within about a texel of it or of one of the texels
    /// around it: only there can a wall part neighbours.
    pub among_others: Vec<bool>,
    /// Mean emitted radiance of the elements that emit, ascending by element.
    pub emission: Vec<(u32, Radiance)>,
    /// Chart of each element.
    pub chart: Vec<u32>,
    /// All charts.
    pub charts: Vec<Chart>,
    /// Texel to element, one map a page.
    pub pages: Vec<PageMap>,
}

impl Elements {
    /// Number of elements.
    pub fn len(&self) -> usize {
        self.position_world.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.position_world.is_empty()
    }

    /// Whether all rays of an element leave the scene.
    pub fn is_open(&self, element: u32, sight: &Sight) -> bool {
        let back = self.charts[self.chart[element as usize] as usize].back;
        sight.is_open(self.triangle[element as usize], usize::from(back))
    }
}
