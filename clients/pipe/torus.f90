! A torus: gfortran -O2 torus.f90 -o torus
!          stellate mesh --oracle-command ./torus -e 0.1 -o torus.obj
program torus
  use iso_fortran_env, only: int8, int32, real64
  implicit none
  integer(int32) :: head(4), n, status
  real(real64), allocatable, dimension(:) :: rho, q, c, s, o, u
  real(real64), allocatable :: x(:, :), y(:, :), tangents(:, :)
  open (10, file="/dev/stdin", access="stream", form="unformatted", action="read")
  open (11, file="/dev/stdout", access="stream", form="unformatted", action="write")
  write (11) "stellate-oracle 1 binary k=2 d=3 tangents=1 box=-1.5,-1.5,-0.5:1.5,1.5,0.5", new_line("a")
  flush (11)
  do
    read (10, iostat=status) head
    if (status /= 0) exit
    n = head(2)
    if (allocated(x)) deallocate (x, y, tangents)
    allocate (x(3, n), y(3, n), tangents(6, n))
    read (10) x  ! a point a column
    rho = hypot(x(1, :), x(2, :))
    q = hypot(rho - 1, x(3, :))
    c = x(1, :)/rho; s = x(2, :)/rho; o = (rho - 1)/q; u = x(3, :)/q
    y(1, :) = (1 + 0.4_real64*o)*c
    y(2, :) = (1 + 0.4_real64*o)*s
    y(3, :) = 0.4_real64*u
    tangents(1, :) = -s; tangents(2, :) = -u*c  ! row by row of a 3 x 2 matrix
    tangents(3, :) = c; tangents(4, :) = -u*s
    tangents(5, :) = 0; tangents(6, :) = o
    write (11) n, 5_int32, y, tangents, merge(1_int8, 0_int8, rho*q > 0)  ! 5: tangents, found
    flush (11)
  end do
end program
