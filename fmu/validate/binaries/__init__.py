"""What shared libraries say of themselves: ELF, Mach-O and PE, read as bytes and never loaded.

It imports nothing of the project.
"""
