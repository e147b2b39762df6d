//! Eight numbers at a time: AVX2 where the processor has it, arrays where not. Both round alike, lane by lane.
//!
//! `max` and `min` give their second argument when a comparison with NaN decides; no operation is fused with another.

use crate::scene::occluders::WIDTH;

/// A block of a mask: eight rows of 32 texels.
pub type Bits = [u32; WIDTH];

pub trait Lanes: Copy {
    type F: Copy;
    fn splat(x: f32) -> Self::F;
    fn load(x: &[f32; WIDTH]) -> Self::F;
    fn store(x: Self::F) -> [f32; WIDTH];
    fn add(a: Self::F, b: Self::F) -> Self::F;
    fn sub(a: Self::F, b: Self::F) -> Self::F;
    fn mul(a: Self::F, b: Self::F) -> Self::F;
    fn div(a: Self::F, b: Self::F) -> Self::F;
    fn max(a: Self::F, b: Self::F) -> Self::F;
    fn min(a: Self::F, b: Self::F) -> Self::F;
    fn ceil(a: Self::F) -> Self::F;
    fn floor(a: Self::F) -> Self::F;
    fn abs(a: Self::F) -> Self::F;
    /// The size of `a` with the sign of `b`.
    fn signed(a: Self::F, b: Self::F) -> Self::F;
    /// `a` where `x < y`, else `b`.
    fn choose_less(x: Self::F, y: Self::F, a: Self::F, b: Self::F) -> Self::F;
    /// Bit i: lane i of `a` is less than that of `b`.
    fn less(a: Self::F, b: Self::F) -> u32;
    /// Bit i: lane i of `a` is at most that of `b`.
    fn at_most(a: Self::F, b: Self::F) -> u32;
    /// `low + 65536 high` of whole numbers from 0 to 32767.
    fn pack(low: Self::F, high: Self::F) -> Bits;
    /// Per lane, the columns from `low` to `high`, whole numbers from -1 to 32767, of the 32 from `first` on.
    fn columns(low: Self::F, high: Self::F, first: i32) -> Bits;
    /// Whether `bits` holds any of `columns` in the rows from `low` to `high` (not above 7).
    fn any(bits: &Bits, low: usize, high: usize, columns: u32) -> bool;
    /// Asks for memory that will be read soon.
    fn prefetch<T>(what: &T);
    /// Takes `gone` away from `bits`; true when nothing is left.
    fn clear(bits: &mut Bits, gone: &Bits) -> bool;
}

#[derive(Clone, Copy)]
pub struct Plain;

#[inline(always)]
fn each(f: impl Fn(usize) -> f32) -> [f32; WIDTH] {
    std::array::from_fn(f)
}

#[inline(always)]
fn bits(f: impl Fn(usize) -> bool) -> u32 {
    (0..WIDTH).fold(0, |bits, i| bits | u32::from(f(i)) << i)
}

/// All 32 columns from `at` on; none from 32 on.
#[inline(always)]
fn from(at: i32) -> u32 {
    u32::MAX.checked_shl(at.max(0) as u32).unwrap_or(0)
}

impl Lanes for Plain {
    type F = [f32; WIDTH];

    #[inline(always)]
    fn splat(x: f32) -> Self::F {
        [x; WIDTH]
    }
    #[inline(always)]
    fn load(x: &[f32; WIDTH]) -> Self::F {
        *x
    }
    #[inline(always)]
    fn store(x: Self::F) -> [f32; WIDTH] {
        x
    }
    #[inline(always)]
    fn add(a: Self::F, b: Self::F) -> Self::F {
        each(|i| a[i] + b[i])
    }
    #[inline(always)]
    fn sub(a: Self::F, b: Self::F) -> Self::F {
        each(|i| a[i] - b[i])
    }
    #[inline(always)]
    fn mul(a: Self::F, b: Self::F) -> Self::F {
        each(|i| a[i] * b[i])
    }
    #[inline(always)]
    fn div(a: Self::F, b: Self::F) -> Self::F {
        each(|i| a[i] / b[i])
    }
    #[inline(always)]
    fn max(a: Self::F, b: Self::F) -> Self::F {
        each(|i| if a[i] > b[i] { a[i] } else { b[i] })
    }
    #[inline(always)]
    fn min(a: Self::F, b: Self::F) -> Self::F {
        each(|i| if a[i] < b[i] { a[i] } else { b[i] })
    }
    #[inline(always)]
    fn ceil(a: Self::F) -> Self::F {
        each(|i| a[i].ceil())
    }
    #[inline(always)]
    fn floor(a: Self::F) -> Self::F {
        each(|i| a[i].floor())
    }
    #[inline(always)]
    fn abs(a: Self::F) -> Self::F {
        each(|i| a[i].abs())
    }
    #[inline(always)]
    fn signed(a: Self::F, b: Self::F) -> Self::F {
        each(|i| a[i].copysign(b[i]))
    }
    #[inline(always)]
    fn choose_less(x: Self::F, y: Self::F, a: Self::F, b: Self::F) -> Self::F {
        each(|i| if x[i] < y[i] { a[i] } else { b[i] })
    }
    #[inline(always)]
    fn less(a: Self::F, b: Self::F) -> u32 {
        bits(|i| a[i] < b[i])
    }
    #[inline(always)]
    fn at_most(a: Self::F, b: Self::F) -> u32 {
        bits(|i| a[i] <= b[i])
    }
    #[inline(always)]
    fn pack(low: Self::F, high: Self::F) -> Bits {
        std::array::from_fn(|i| low[i] as u32 | (high[i] as u32) << 16)
    }
    #[inline(always)]
    fn columns(low: Self::F, high: Self::F, first: i32) -> Bits {
        std::array::from_fn(|i| from(low[i] as i32 - first) & !from(high[i] as i32 + 1 - first))
    }
    #[inline(always)]
    fn any(bits: &Bits, low: usize, high: usize, columns: u32) -> bool {
        bits[low..=high].iter().any(|row| row & columns != 0)
    }
    #[inline(always)]
    fn prefetch<T>(_: &T) {}
    #[inline(always)]
    fn clear(bits: &mut Bits, gone: &Bits) -> bool {
        bits.iter_mut().zip(gone).for_each(|(row, gone)| *row &= !gone);
        bits.iter().all(|row| *row == 0)
    }
}

#[cfg(target_arch = "x86_64")]
pub use avx2::Avx2;

#[cfg(target_arch = "x86_64")]
mod avx2 {
    use super::{Bits, Lanes, WIDTH};
    use std::arch::x86_64::*;

    /// To be used only where AVX2 was found; its functions become part of one that is compiled for it.
    #[derive(Clone, Copy)]
    pub struct Avx2;

    /// Rows from a number on: eight of these from `8 - low` on are all ones from `low`.
    static ROWS: [u32; 16] = [0, 0, 0, 0, 0, 0, 0, 0, !0, !0, !0, !0, !0, !0, !0, !0];

    // SAFETY of all below: the caller of `Avx2` has found the feature; loads and stores are of eight elements inside
    // arrays of eight, or of sixteen with an offset of at most eight.
    impl Lanes for Avx2 {
        type F = __m256;

        #[inline(always)]
        fn splat(x: f32) -> __m256 {
            unsafe { _mm256_set1_ps(x) }
        }
        #[inline(always)]
        fn load(x: &[f32; WIDTH]) -> __m256 {
            unsafe { _mm256_loadu_ps(x.as_ptr()) }
        }
        #[inline(always)]
        fn store(x: __m256) -> [f32; WIDTH] {
            let mut out = [0.0; WIDTH];
            unsafe { _mm256_storeu_ps(out.as_mut_ptr(), x) };
            out
        }
        #[inline(always)]
        fn add(a: __m256, b: __m256) -> __m256 {
            unsafe { _mm256_add_ps(a, b) }
        }
        #[inline(always)]
        fn sub(a: __m256, b: __m256) -> __m256 {
            unsafe { _mm256_sub_ps(a, b) }
        }
        #[inline(always)]
        fn mul(a: __m256, b: __m256) -> __m256 {
            unsafe { _mm256_mul_ps(a, b) }
        }
        #[inline(always)]
        fn div(a: __m256, b: __m256) -> __m256 {
            unsafe { _mm256_div_ps(a, b) }
        }
        #[inline(always)]
        fn max(a: __m256, b: __m256) -> __m256 {
            unsafe { _mm256_max_ps(a, b) }
        }
        #[inline(always)]
        fn min(a: __m256, b: __m256) -> __m256 {
            unsafe { _mm256_min_ps(a, b) }
        }
        #[inline(always)]
        fn ceil(a: __m256) -> __m256 {
            unsafe { _mm256_ceil_ps(a) }
        }
        #[inline(always)]
        fn floor(a: __m256) -> __m256 {
            unsafe { _mm256_floor_ps(a) }
        }
        #[inline(always)]
        fn abs(a: __m256) -> __m256 {
            unsafe { _mm256_andnot_ps(_mm256_set1_ps(-0.0), a) }
        }
        #[inline(always)]
        fn signed(a: __m256, b: __m256) -> __m256 {
            unsafe {
                let sign = _mm256_set1_ps(-0.0);
                _mm256_or_ps(_mm256_and_ps(sign, b), _mm256_andnot_ps(sign, a))
            }
        }
        #[inline(always)]
        fn choose_less(x: __m256, y: __m256, a: __m256, b: __m256) -> __m256 {
            unsafe { _mm256_blendv_ps(b, a, _mm256_cmp_ps::<_CMP_LT_OQ>(x, y)) }
        }
        #[inline(always)]
        fn less(a: __m256, b: __m256) -> u32 {
            unsafe { _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LT_OQ>(a, b)) as u32 }
        }
        #[inline(always)]
        fn at_most(a: __m256, b: __m256) -> u32 {
            unsafe { _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(a, b)) as u32 }
        }
        #[inline(always)]
        fn pack(low: __m256, high: __m256) -> Bits {
            unsafe {
                let high = _mm256_slli_epi32::<16>(_mm256_cvttps_epi32(high));
                keep(_mm256_or_si256(_mm256_cvttps_epi32(low), high))
            }
        }
        #[inline(always)]
        fn columns(low: __m256, high: __m256, first: i32) -> Bits {
            unsafe {
                let first = _mm256_set1_epi32(first);
                let low = _mm256_sub_epi32(_mm256_cvttps_epi32(low), first);
                let past = _mm256_sub_epi32(_mm256_cvttps_epi32(high), first);
                let past = _mm256_add_epi32(past, _mm256_set1_epi32(1));
                keep(_mm256_andnot_si256(from(past), from(low)))
            }
        }
        #[inline(always)]
        fn any(bits: &Bits, low: usize, high: usize, columns: u32) -> bool {
            debug_assert!(low < WIDTH && high < WIDTH);
            unsafe {
                let rows = _mm256_andnot_si256(rows(high + 1), rows(low));
                let texels = _mm256_and_si256(rows, _mm256_set1_epi32(columns as i32));
                _mm256_testz_si256(get(bits), texels) == 0
            }
        }
        #[inline(always)]
        fn prefetch<T>(what: &T) {
            let start = std::ptr::from_ref(what).cast::<i8>();
            for line in (0..size_of::<T>()).step_by(64) {
                unsafe { _mm_prefetch::<_MM_HINT_T0>(start.add(line)) };
            }
        }
        #[inline(always)]
        fn clear(bits: &mut Bits, gone: &Bits) -> bool {
            unsafe {
                let left = _mm256_andnot_si256(get(gone), get(bits));
                *bits = keep(left);
                _mm256_testz_si256(left, left) == 1
            }
        }
    }

    /// All 32 columns from `at` on; a shift by 32 or more gives none.
    #[inline(always)]
    unsafe fn from(at: __m256i) -> __m256i {
        unsafe { _mm256_sllv_epi32(_mm256_set1_epi32(-1), _mm256_max_epi32(at, _mm256_setzero_si256())) }
    }

    /// All of the eight rows from `from`, at most 8, on.
    #[inline(always)]
    unsafe fn rows(from: usize) -> __m256i {
        unsafe { _mm256_loadu_si256(ROWS[WIDTH - from..].as_ptr().cast()) }
    }

    #[inline(always)]
    unsafe fn get(bits: &Bits) -> __m256i {
        unsafe { _mm256_loadu_si256(bits.as_ptr().cast()) }
    }

    #[inline(always)]
    unsafe fn keep(bits: __m256i) -> Bits {
        let mut out = [0; WIDTH];
        unsafe { _mm256_storeu_si256(out.as_mut_ptr().cast(), bits) };
        out
    }
}
