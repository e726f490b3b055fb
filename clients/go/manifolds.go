package stellate

import "math"

// Torus is the torus of tube radius Minor around a circle of radius Major: k = 2, d = 3.
type Torus struct{ Major, Minor float64 }

func (Torus) Dimension() int        { return 2 }
func (Torus) AmbientDimension() int { return 3 }
func (Torus) ConcurrencySafe() bool { return true }

func (t Torus) BoundingBox() (lower, upper []float64) {
	across, up := 1.1*(t.Major+t.Minor), 1.1*t.Minor
	return []float64{-across, -across, -up}, []float64{across, across, up}
}

func (t Torus) ClosestPoint(x, points []float64, found []bool) error {
	for i := range found {
		p, q := x[3*i:3*i+3], points[3*i:3*i+3]
		ring := math.Sqrt(p[0]*p[0] + p[1]*p[1])
		off := ring - t.Major
		tube := math.Sqrt(off*off + p[2]*p[2])
		if found[i] = ring > 1e-12 && tube > 1e-12; !found[i] {
			continue
		}
		scale := (t.Major + t.Minor*off/tube) / ring
		q[0], q[1], q[2] = p[0]*scale, p[1]*scale, t.Minor*p[2]/tube
	}
	return nil
}

func (t Torus) TangentBasis(points, bases []float64) error {
	for i := range len(points) / 3 {
		p, b := points[3*i:3*i+3], bases[6*i:6*i+6]
		ring := math.Sqrt(p[0]*p[0] + p[1]*p[1])
		c, s := p[0]/ring, p[1]/ring
		out, up := (ring-t.Major)/t.Minor, p[2]/t.Minor
		b[0], b[2], b[4] = -s, c, 0
		b[1], b[3], b[5] = -c*up, -s*up, out
	}
	return nil
}

// ProductOfCircles is T^K as a product of unit circles in R^2K; for K = 2 the Clifford torus.
type ProductOfCircles struct{ K int }

func (m ProductOfCircles) Dimension() int        { return m.K }
func (m ProductOfCircles) AmbientDimension() int { return 2 * m.K }
func (ProductOfCircles) ConcurrencySafe() bool   { return true }

func (m ProductOfCircles) BoundingBox() (lower, upper []float64) {
	for range 2 * m.K {
		lower, upper = append(lower, -1.1), append(upper, 1.1)
	}
	return lower, upper
}

func (m ProductOfCircles) ClosestPoint(x, points []float64, found []bool) error {
	for i := 0; i < len(x); i += 2 {
		length := math.Sqrt(x[i]*x[i] + x[i+1]*x[i+1])
		if !(length > 1e-12) {
			found[i/(2*m.K)] = false
			continue
		}
		points[i], points[i+1] = x[i]/length, x[i+1]/length
	}
	return nil
}

func (m ProductOfCircles) TangentBasis(points, bases []float64) error {
	for i := 0; i < len(points); i += 2 {
		a := i / 2 % m.K
		bases[i*m.K+a], bases[(i+1)*m.K+a] = -points[i+1], points[i]
	}
	return nil
}
