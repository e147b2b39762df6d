//! Scenes that ship in the program: made here, no file needed.
