"""Pure NumPy twin of the library, written from the equations and importing nothing of losnav.

Readable first: one problem at a time, loops welcome, complex numbers allowed where a derivative
is taken by complex step, and other factorisations (QR, SVD, eigenvectors) than the library's.
"""
