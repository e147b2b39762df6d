//! Which points no other beats.

use super::Caches;
use super::measure::Point;

/// For each point, whether it is on the front, by `Caches`.
pub fn fronts(points: &[Point]) -> Vec<[bool; 2]> {
    let [cold, warm] = Caches::BOTH.map(|caches| {
        let places: Vec<[f64; 2]> = points.iter().map(|point| point.place(caches)).collect();
        front(&places)
    });
    cold.into_iter().zip(warm).map(|(cold, warm)| [cold, warm]).collect()
}

/// A place is on the front when no other is as good in both and better in one; smaller is better.
fn front(places: &[[f64; 2]]) -> Vec<bool> {
    let beats = |a: &[f64; 2], b: &[f64; 2]| a[0] <= b[0] && a[1] <= b[1] && a != b;
    places.iter().map(|place| !places.iter().any(|other| beats(other, place))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_beaten_is_not_on_the_front() {
        let places = [[1.0, 9.0], [2.0, 5.0], [2.0, 6.0], [3.0, 5.0], [4.0, 1.0], [4.0, 1.0], [9.0, 9.0]];
        assert_eq!(front(&places), [true, true, false, false, true, true, false]);
        assert!(front(&[]).is_empty());
    }
}
