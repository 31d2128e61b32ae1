"""References to cite for the methods of models."""

LAYERS = (
    "E. Kausel, J. M. Roesset: Stiffness matrices for layered soils. Bulletin of the Seismological "
    "Society of America 71 (1981) 1743-1761"
)
REDUCTION = (
    "Z. Bai, Y. Su: Dimension reduction of large-scale second-order dynamical systems via a "
    "second-order Arnoldi method. SIAM Journal on Scientific Computing 26 (2005) 1692-1709"
)
ARNOLDI = (
    "D. Lu, Y. Su, Z. Bai: Stability analysis of the two-level orthogonal Arnoldi procedure. SIAM "
    "Journal on Matrix Analysis and Applications 37 (2016) 195-214"
)
ALPHA = (
    "J. Chung, G. M. Hulbert: A time integration algorithm for structural dynamics with improved "
    "numerical dissipation: the generalized-alpha method. Journal of Applied Mechanics 60 (1993) "
    "371-375. doi 10.1115/1.2900803"
)
NEWTON = (
    "T. Belytschko, W. K. Liu, B. Moran: Nonlinear Finite Elements for Continua and Structures. "
    "Wiley, 2000"
)
MACROELEMENTS = (
    "R. Stenberg: Analysis of mixed finite element methods for the Stokes problem: a unified "
    "approach. Mathematics of Computation 42 (1984) 9-23"
)
PLATES = "A. W. Leissa: Vibration of Plates. NASA SP-160, 1969"
KARMAN = (
    "S. Bilbao, O. Thomas, C. Touze, M. Ducceschi: Conservative numerical methods for the full von "
    "Karman plate equations. Numerical Methods for Partial Differential Equations 31 (2015) "
    "1948-1970. doi 10.1002/num.21974"
)
