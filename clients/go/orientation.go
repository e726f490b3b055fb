package stellate

import "slices"

// orient gives the same simplices, some with their last two vertices exchanged, so that neighbours
// induce opposite orientations on the facet they share; the first of each component stays, but that
// those of a hypersurface are turned as a whole where their normals point inwards. nil if that cannot
// be: the complex is not orientable, or a facet is in more than two simplices. Rows have to be ascending.
func orient(simplices []uint32, width int, points []float64, d int) []uint32 {
	count := len(simplices) / width
	// Facet f is that of simplex f / width without its vertex f % width.
	facets := make([]uint32, 0, count*width*(width-1))
	for s := range count {
		row := simplices[s*width : (s+1)*width]
		for left := range width {
			facets = append(append(facets, row[:left]...), row[left+1:]...)
		}
	}
	other := slices.Repeat([]int32{-1}, count*width)
	order := sortedOrder(facets, width-1)
	for i := 1; i < len(order); i++ {
		a, b := order[i-1], order[i]
		if !slices.Equal(rowAt(facets, width-1, a), rowAt(facets, width-1, b)) {
			continue
		}
		if other[a] >= 0 {
			return nil
		}
		other[a], other[b] = b, a
	}
	turned := make([]int8, count) // 0: not seen, 1: as it is, -1: turned
	oriented := slices.Clone(simplices)
	for start := range count {
		if turned[start] != 0 {
			continue
		}
		turned[start] = 1
		component := []int{start}
		for at := 0; at < len(component); at++ {
			s := component[at]
			for i := range width {
				facet := int(other[s*width+i])
				if facet < 0 {
					continue
				}
				neighbour, wanted := facet/width, turned[s]
				if (i-facet%width)%2 == 0 { // of like parity: the facets have like orientations
					wanted = -wanted
				}
				if turned[neighbour] == -wanted {
					return nil
				}
				if turned[neighbour] == 0 {
					turned[neighbour] = wanted
					component = append(component, neighbour)
				}
			}
		}
		volume := 0.0 // (k+1)! times those of the cones from the origin
		for _, s := range component {
			row := oriented[s*width : (s+1)*width]
			if turned[s] < 0 {
				exchange(row)
			}
			if width == d {
				var corners [][]float64
				for _, id := range row {
					corners = append(corners, points[int(id)*d:(int(id)+1)*d])
				}
				volume += determinant(corners)
			}
		}
		if volume < 0 {
			for _, s := range component {
				exchange(oriented[s*width : (s+1)*width])
			}
		}
	}
	return oriented
}

func exchange(row []uint32) {
	last := len(row) - 1
	row[last-1], row[last] = row[last], row[last-1]
}

func determinant(rows [][]float64) float64 {
	if len(rows) == 1 {
		return rows[0][0]
	}
	sum, sign := 0.0, 1.0
	for i, row := range rows {
		var minor [][]float64
		for j, other := range rows {
			if j != i {
				minor = append(minor, other[1:])
			}
		}
		sum += sign * row[0] * determinant(minor)
		sign = -sign
	}
	return sum
}
