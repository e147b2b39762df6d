//! Ids of names.

/// The id of a name: MurmurHash3 (x86, 32 bit, seed 0) of its UTF-8, made the bits of a finite float that is not
/// denormal.
pub fn id(name: &str) -> u32 {
    let hash = murmur3(name.as_bytes());
    let exponent = hash >> 23 & 255;
    if exponent == 0 || exponent == 255 { hash ^ 1 << 23 } else { hash }
}

fn murmur3(bytes: &[u8]) -> u32 {
    let mix = |k: u32| k.wrapping_mul(0xcc9e2d51).rotate_left(15).wrapping_mul(0x1b873593);
    let (words, tail) = bytes.as_chunks::<4>();
    let mut hash = words.iter().fold(0u32, |hash, word| {
        (hash ^ mix(u32::from_le_bytes(*word))).rotate_left(13).wrapping_mul(5).wrapping_add(0xe6546b64)
    });
    hash ^= mix(tail.iter().rev().fold(0, |word, &byte| word << 8 | u32::from(byte)));
    hash ^= bytes.len() as u32;
    hash = (hash ^ hash >> 16).wrapping_mul(0x85ebca6b);
    hash = (hash ^ hash >> 13).wrapping_mul(0xc2b2ae35);
    hash ^ hash >> 16
}

/// What a matte's headers begin with: `cryptomatte/` and seven digits of its name's id.
pub fn header_key(matte: &str) -> String {
    format!("cryptomatte/{}", &format!("{:08x}", id(matte))[..7])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hashes_names() {
        assert_eq!(id("torus"), 0xf19c73fd);
        assert_eq!(id("floor"), 0x7819c83c);
        assert_eq!(id("hello"), 0x248bfa47);
        assert_eq!(murmur3(b""), 0);
        assert_eq!(id(""), 1 << 23, "an exponent of 0 is moved out of the denormals");
    }
}
