//! Rectangles of pixels.

/// The pixels `min.0 ≤ x < max.0`, `min.1 ≤ y < max.1` of the full film, whose
/// top left pixel is (0, 0). Empty when an end is not above its start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Rect {
    /// First column and row.
    pub min: (i32, i32),
    /// One past the last column and row.
    pub max: (i32, i32),
}

impl Rect {
    /// The rectangle of a corner and a size.
    #[must_use]
    pub fn new(x: i32, y: i32, width: u32, height: u32) -> Rect {
        Rect { min: (x, y), max: (x.saturating_add_unsigned(width), y.saturating_add_unsigned(height)) }
    }

    /// Columns.
    #[must_use]
    pub fn width(&self) -> usize {
        (i64::from(self.max.0) - i64::from(self.min.0)).max(0) as usize
    }

    /// Rows.
    #[must_use]
    pub fn height(&self) -> usize {
        (i64::from(self.max.1) - i64::from(self.min.1)).max(0) as usize
    }

    /// Number of pixels.
    #[must_use]
    pub fn area(&self) -> usize {
        self.width() * self.height()
    }

    /// True when there is no pixel.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.width() == 0 || self.height() == 0
    }

    /// The pixels in both.
    #[must_use]
    pub fn intersect(&self, other: &Rect) -> Rect {
        Rect {
            min: (self.min.0.max(other.min.0), self.min.1.max(other.min.1)),
            max: (self.max.0.min(other.max.0), self.max.1.min(other.max.1)),
        }
    }

    /// Larger by `n` pixels on each side.
    #[must_use]
    pub fn grow(&self, n: i32) -> Rect {
        Rect { min: (self.min.0 - n, self.min.1 - n), max: (self.max.0 + n, self.max.1 + n) }
    }

    /// True when the pixel is one of these.
    #[must_use]
    pub fn contains(&self, (x, y): (i32, i32)) -> bool {
        (self.min.0..self.max.0).contains(&x) && (self.min.1..self.max.1).contains(&y)
    }

    /// All pixels, row by row.
    pub fn pixels(&self) -> impl Iterator<Item = (i32, i32)> + use<> {
        let Rect { min, max } = *self;
        (min.1..max.1).flat_map(move |y| (min.0..max.0).map(move |x| (x, y)))
    }

    /// Row-major index of a pixel of this rectangle.
    #[must_use]
    pub fn index(&self, (x, y): (i32, i32)) -> usize {
        debug_assert!(self.contains((x, y)), "pixel ({x}, {y}) outside {self:?}");
        (y - self.min.1) as usize * self.width() + (x - self.min.0) as usize
    }
}
