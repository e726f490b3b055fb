! The Clifford torus: gfortran -O2 clifford.f90 -o clifford
!                     stellate mesh --oracle-command ./clifford -e 0.2 -o clifford.txt
program clifford
  use iso_fortran_env, only: int8, int32, real64
  implicit none
  integer(int32) :: head(4), n, status
  real(real64), allocatable :: x(:, :), a(:), b(:), tangents(:, :)
  open (10, file="/dev/stdin", access="stream", form="unformatted", action="read")
  open (11, file="/dev/stdout", access="stream", form="unformatted", action="write")
  write (11) "stellate-oracle 1 binary k=2 d=4 tangents=1 box=-1,-1,-1,-1:1,1,1,1", new_line("a")
  flush (11)
  do
    read (10, iostat=status) head
    if (status /= 0) exit
    n = head(2)
    if (allocated(x)) deallocate (x, tangents)
    allocate (x(4, n), tangents(8, n))
    read (10) x
    a = hypot(x(1, :), x(2, :))
    b = hypot(x(3, :), x(4, :))
    x(1, :) = x(1, :)/a; x(2, :) = x(2, :)/a
    x(3, :) = x(3, :)/b; x(4, :) = x(4, :)/b
    tangents = 0
    tangents(1, :) = -x(2, :); tangents(3, :) = x(1, :)
    tangents(6, :) = -x(4, :); tangents(8, :) = x(3, :)
    write (11) n, 5_int32, sqrt(0.5_real64)*x, tangents, merge(1_int8, 0_int8, a*b > 0)
    flush (11)
  end do
end program
