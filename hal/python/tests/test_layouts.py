"""The structures as this Python lays them out against what the Rust compiler made of the messages."""

import ctypes
import unittest

from magsteer import messages


class Layouts(unittest.TestCase):
    def test_sizes_and_offsets_are_those_of_rust(self):
        self.assertGreaterEqual(len(messages.LAYOUTS), 12)
        for name, (size, offsets) in messages.LAYOUTS.items():
            structure = getattr(messages, name)
            self.assertEqual(ctypes.sizeof(structure), size, name)
            self.assertEqual([field[0] for field in structure._fields_], list(offsets), name)
            for field, offset in offsets.items():
                self.assertEqual(getattr(structure, field).offset, offset, f"{name}.{field}")

    def test_fields_leave_no_hole_in_which_garbage_could_travel(self):
        for name, (size, offsets) in messages.LAYOUTS.items():
            structure = getattr(messages, name)
            used = sum(getattr(structure, field).size for field in offsets)
            self.assertEqual(used, size, name)


if __name__ == "__main__":
    unittest.main()
