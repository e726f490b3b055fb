package stellate

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

func takeRows(rows []uint32, width int, chosen []int32) []uint32 {
	taken := make([]uint32, 0, len(chosen)*width)
	for _, i := range chosen {
		taken = append(taken, rowAt(rows, width, i)...)
	}
	return taken
}
