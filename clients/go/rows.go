package stellate

import "slices"

// Rows of vertex numbers, [m, width] one after the other, in lexicographic order.

// sortedOrder gives the order that sorts the rows; equal rows keep theirs. One counting sort a column.
func sortedOrder(rows []uint32, width int) []int32 {
	count := len(rows) / width
	order, next := make([]int32, count), make([]int32, count)
	for i := range order {
		order[i] = int32(i)
	}
	most := uint32(0)
	for _, id := range rows {
		most = max(most, id)
	}
	start := make([]int32, int(most)+2)
	for column := width - 1; column >= 0; column-- {
		clear(start)
		for i := column; i < len(rows); i += width {
			start[rows[i]+1]++
		}
		for id := range most {
			start[id+1] += start[id]
		}
		for _, row := range order {
			id := rows[int(row)*width+column]
			next[start[id]] = row
			start[id]++
		}
		order, next = next, order
	}
	return order
}

func rowAt(rows []uint32, width int, i int32) []uint32 {
	return rows[int(i)*width : (int(i)+1)*width]
}

// bitsOf tells by a bit which of the rows, that are in order, are among the chosen ones, in any order.
func bitsOf(rows, chosen []uint32, width int) []byte {
	bits := make([]byte, bytesOfBits(len(rows)/width))
	order := sortedOrder(chosen, width)
	for s := 0; s < len(rows)/width && len(order) > 0; s++ {
		if slices.Equal(rowAt(rows, width, int32(s)), rowAt(chosen, width, order[0])) {
			bits[s/8] |= 1 << (s % 8)
			order = order[1:]
		}
	}
	return bits
}

func bytesOfBits(count int) int { return (count + 7) / 8 }

func isSet(bits []byte, i int) bool { return bits[i/8]>>(i%8)&1 == 1 }

func takeRows(rows []uint32, width int, chosen []int32) []uint32 {
	taken := make([]uint32, 0, len(chosen)*width)
	for _, i := range chosen {
		taken = append(taken, rowAt(rows, width, i)...)
	}
	return taken
}
