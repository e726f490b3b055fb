package stellate

import "slices"

// orient gives the same simplices, some with their first two vertices exchanged, so that neighbours
// induce opposite orientations on the facet they share; nil if that cannot be: the complex is not
// orientable, or a facet is in more than two simplices. Rows have to be ascending.
func orient(simplices []uint32, width int) []uint32 {
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
		for front := []int{start}; len(front) > 0; {
			s := front[len(front)-1]
			front = front[:len(front)-1]
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
					front = append(front, neighbour)
				}
			}
		}
	}
	for s := range count {
		if turned[s] < 0 {
			oriented[s*width], oriented[s*width+1] = oriented[s*width+1], oriented[s*width]
		}
	}
	return oriented
}
