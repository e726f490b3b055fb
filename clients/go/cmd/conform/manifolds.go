package main

import (
	"errors"
	"math"
	"slices"
	"strconv"
	"strings"
	"time"

	"stellate"
)

var torus = stellate.Torus{Major: 1, Minor: 0.4}

// seeded has a seed, and no box.
type seeded struct {
	stellate.Oracle
	stellate.TangentBaser
}

func (seeded) Seeds() []float64 { return []float64{1.4, 0, 0} }

// changed is the torus, after something was done to its answers.
type changed struct {
	stellate.Torus
	change func(x []float64, found []bool) error
}

func (c changed) ClosestPoint(x, points []float64, found []bool) error {
	if err := c.Torus.ClosestPoint(x, points, found); err != nil {
		return err
	}
	return c.change(x, found)
}

// circle is the unit circle of the first two coordinates of R^d.
type circle struct{ d int }

func (circle) Dimension() int          { return 1 }
func (c circle) AmbientDimension() int { return c.d }

func (c circle) ClosestPoint(x, points []float64, found []bool) error {
	for i := 0; i < len(x); i += c.d {
		length := math.Hypot(x[i], x[i+1])
		points[i], points[i+1] = x[i]/length, x[i+1]/length
	}
	return nil
}

func (c circle) TangentBasis(points, bases []float64) error {
	for i := 0; i < len(points); i += c.d {
		bases[i], bases[i+1] = -points[i+1], points[i]
	}
	return nil
}

// sphere is the unit sphere, which meets lines; its sizes are 1 + z / 2.
type sphere struct{}

func (sphere) Dimension() int        { return 2 }
func (sphere) AmbientDimension() int { return 3 }

func dot(a, b []float64) float64 { return a[0]*b[0] + a[1]*b[1] + a[2]*b[2] }

func (sphere) ClosestPoint(x, points []float64, found []bool) error {
	for i := range x {
		from := x[i/3*3 : i/3*3+3]
		points[i] = x[i] / math.Sqrt(dot(from, from))
	}
	return nil
}

func (sphere) TangentBasis(points, bases []float64) error {
	for i := range len(points) / 3 {
		x, y, z := points[3*i], points[3*i+1], points[3*i+2]
		s := math.Copysign(1, z)
		a := -1 / (s + z)
		copy(bases[6*i:], []float64{1 + s*x*x*a, x * y * a, s * x * y * a, s + y*y*a, -s * x, -y})
	}
	return nil
}

func (sphere) LocalSize(points, sizes []float64) error {
	for i := range sizes {
		sizes[i] = 1 + points[3*i+2]/2
	}
	return nil
}

func (sphere) IntersectFlat(centers, bases, radii, points []float64, found []bool) error {
	for i := range found {
		c, b := centers[3*i:3*i+3], bases[6*i:6*i+6]
		along := []float64{b[2]*b[5] - b[4]*b[3], b[4]*b[1] - b[0]*b[5], b[0]*b[3] - b[2]*b[1]}
		middle := dot(along, c)
		root := middle*middle - dot(c, c) + 1
		step := math.Copysign(math.Sqrt(math.Max(root, 0)), middle) - middle
		found[i] = root >= 0 && math.Abs(step) <= radii[i]
		for j, u := range along {
			points[3*i+j] = c[j] + step*u
		}
	}
	return nil
}

// lune is the part of the sphere where z and y are not negative, its two walls.
type lune struct{ sphere }

func axis(wall int) int { return 2 - wall }

func (lune) Walls() int { return 2 }

func (lune) BoundingBox() (lower, upper []float64) {
	return []float64{-1.1, -1.1, -1.1}, []float64{1.1, 1.1, 1.1}
}

func (l lune) FacePoint(x []float64, face []uint32, points []float64, found []bool) error {
	flat := slices.Clone(x)
	for _, wall := range face {
		for i := axis(int(wall)); i < len(flat); i += 3 {
			flat[i] = 0
		}
	}
	for i := range found {
		at := flat[3*i : 3*i+3]
		found[i] = dot(at, at) > 0
	}
	return l.ClosestPoint(flat, points, nil)
}

func (lune) Clearances(points, values []float64) error {
	for i := range values {
		values[i] = points[i/2*3+axis(i%2)]
	}
	return nil
}

func (lune) Conormals(_ []float64, face []uint32, normals []float64) error {
	for i := range len(normals) / 3 {
		normals[3*i+axis(int(face[i%len(face)]))] = -1
	}
	return nil
}

func manifold(name string) stellate.Oracle {
	if d, is := strings.CutPrefix(name, "circle:"); is {
		number, _ := strconv.Atoi(d)
		return circle{number}
	}
	switch name {
	case "torus":
		return torus
	case "clifford":
		return stellate.ProductOfCircles{K: 2}
	case "sphere":
		return sphere{}
	case "lune":
		return lune{}
	case "half":
		return changed{torus, func(x []float64, found []bool) error {
			for i := range found {
				found[i] = found[i] && x[3*i] >= 0
			}
			return nil
		}}
	case "raises":
		return changed{torus, func([]float64, []bool) error { return errors.New("on purpose") }}
	case "slow":
		return changed{torus, func([]float64, []bool) error {
			time.Sleep(2 * time.Second)
			return nil
		}}
	}
	return nil
}
