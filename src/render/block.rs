//! The samples of one index in the pixels of a block, which use each other's paths.

use crate::film::{FilmSpec, PixelSample, Rect, TILE_SIZE};
use crate::integrator::{CameraSample, Counters, Lender, Links, Path, Record, exchange};
use crate::math::Vec2;
use crate::sampling::{Sampler, Sequence};
use crate::scene::Scene;

/// Room for the samples of a block; used again for the next index and block.
///
/// All pixels of the block are traced, those outside of a crop window too: their paths are
/// used within, and the picture of a crop is that of the whole.
pub struct Block<'s> {
    scene: &'s Scene,
    path: &'s Path,
    /// Pixels of the whole film that there can be samples of.
    whole: Rect,
    side: i32,
    area: Rect,
    lenders: Vec<Lender<'s>>,
    offsets: Vec<Vec2>,
    /// Those that have something to connect, as they are put into groups.
    order: Vec<(Rank, usize)>,
    group: Vec<usize>,
    room: Links,
}

/// Side of large blocks, and how many there must be.
const LARGE: i32 = 2 * TILE_SIZE;
const MANY: u32 = 48;

/// Where a pixel stands among the others: first the depth of its first vertex, which a group
/// must have in common, then what that vertex lies on and how it is turned, since it is the like
/// that have use for each other; last a random number. Pixels side by side share too, but so
/// rarely that the noise of a picture stays nearly white.
type Rank = (u32, u64, u32);

/// The random numbers of a pass: what gives the sampler of each pixel.
#[derive(Clone, Copy, Debug)]
pub struct Draw {
    /// Seed of the render or of the replica.
    pub seed: u64,
    /// Index within it.
    pub index: u64,
    /// How the samples of a pixel are spread.
    pub sequence: Sequence,
    /// Somebody wants the layers that the first hit decides.
    pub layers: bool,
}

impl Draw {
    /// The random numbers of a pixel.
    #[must_use]
    pub fn sampler(&self, pixel: (i32, i32)) -> Sampler {
        Sampler::new(self.seed, pixel, self.index).with_sequence(self.sequence)
    }
}

impl<'s> Block<'s> {
    /// Pixels along the side of the blocks of a film. In larger ones the pixels of a group are
    /// further apart, which keeps the noise whiter; small pictures have too few of them for
    /// many threads.
    #[must_use]
    pub fn side(film: &FilmSpec) -> i32 {
        let [width, height] = film.size.map(|n| n.div_ceil(LARGE as u32));
        if width.saturating_mul(height) < MANY { TILE_SIZE } else { LARGE }
    }

    /// Room for the blocks of the scene's film.
    pub fn new(scene: &'s Scene, path: &'s Path) -> Block<'s> {
        Block::of_side(scene, path, Block::side(&scene.film))
    }

    /// The same for blocks of another size.
    pub fn of_side(scene: &'s Scene, path: &'s Path, side: i32) -> Block<'s> {
        let FilmSpec { size: [width, height], .. } = scene.film;
        let whole = FilmSpec { crop: [0, 0, width, height], ..scene.film.clone() }.sample_bounds();
        Block {
            scene,
            path,
            whole,
            side,
            area: Rect::default(),
            lenders: Vec::new(),
            offsets: Vec::new(),
            order: Vec::new(),
            group: Vec::new(),
            room: Links::default(),
        }
    }

    /// Moves to the block that a pixel is in.
    pub fn move_to(&mut self, pixel: (i32, i32)) {
        let corner = |x: i32| x.div_euclid(self.side) * self.side;
        let side = self.side as u32;
        self.area = Rect::new(corner(pixel.0), corner(pixel.1), side, side).intersect(&self.whole);
        self.lenders.resize_with(self.area.area(), Lender::default);
        self.offsets.resize(self.area.area(), Vec2::ZERO);
    }

    /// Takes a sample of every pixel.
    pub fn sample<R: Record<'s>>(&mut self, draw: &Draw, record: &mut R) {
        self.trace(draw, record);
        self.share(self.path.reuse, record.counters());
    }

    /// Traces the paths of a sample of every pixel.
    pub fn trace<R: Record<'s>>(&mut self, draw: &Draw, record: &mut R) {
        self.order.clear();
        for (i, pixel) in self.area.pixels().enumerate() {
            let sampler = draw.sampler(pixel);
            let (mut camera, offset) = CameraSample::new(self.scene, pixel, sampler);
            camera.layers = draw.layers;
            self.offsets[i] = offset;
            self.lenders[i].trace(self.path, self.scene, &camera, record);
            if let Some((depth, kind)) = self.lenders[i].kind() {
                self.order.push(((depth, kind, sampler.rank()), i));
            }
        }
        self.order.sort_unstable();
    }

    /// Lets groups of so many pixels use what has been traced.
    pub fn share(&mut self, pixels: u32, counters: &mut Counters) {
        for same_depth in self.order.chunk_by(|a, b| a.0.0 == b.0.0) {
            // Groups as even as they can be.
            let count = same_depth.len().div_ceil(pixels as usize);
            let cut = |k: usize| same_depth.len() * k / count;
            for k in 0..count {
                self.group.clear();
                self.group.extend(same_depth[cut(k)..cut(k + 1)].iter().map(|(_, i)| *i));
                exchange(self.scene, &mut self.lenders, &self.group, &mut self.room, counters);
            }
        }
    }

    /// Bsdfs evaluated for paths of others so far.
    pub fn evaluations(&self) -> u64 {
        self.room.evaluations
    }

    /// The paths of all pixels of the block, row by row.
    pub fn lenders(&mut self) -> &mut Vec<Lender<'s>> {
        &mut self.lenders
    }

    /// The path of a pixel of the block.
    pub fn path_of(&self, pixel: (i32, i32)) -> &Lender<'s> {
        &self.lenders[self.area.index(pixel)]
    }

    /// What a pixel of the block got, and where in the pixel it was sampled.
    pub fn of(&self, pixel: (i32, i32)) -> (&PixelSample, Vec2) {
        let i = self.area.index(pixel);
        (&self.lenders[i].sample, self.offsets[i])
    }
}
